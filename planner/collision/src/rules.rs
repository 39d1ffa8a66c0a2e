//! The rules that both checks keep: distances, the contact rule's switch, and what breaks them.

use nalgebra::Point3;
use nullsweep_robot::Tool;

/// What the fast check asks for beyond every margin, so that its rounding never makes it pass what
/// the exact check rejects. \[m\]
pub(crate) const TOLERANCE: f64 = 1e-8;

/// Distances to keep, all finite and at least 0. \[m\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Between shapes of the robot.
    pub self_clearance: f64,
    /// Between the robot and the environment (measured points, unseen space, obstacles).
    pub environment: f64,
    /// How far the contact prism reaches beyond the pad's sides; also the pad's own margin to points
    /// outside the prism while contact is allowed.
    pub contact_growth: f64,
    /// How far the contact prism reaches before the pad's plane.
    pub contact_front: f64,
    /// What rigid shapes that do not move against the tip keep from points while contact is allowed.
    pub contact_clearance: f64,
}

impl Default for Margins {
    fn default() -> Self {
        Self {
            self_clearance: 0.005,
            environment: 0.005,
            contact_growth: 0.005,
            contact_front: 0.015,
            contact_clearance: 0.001,
        }
    }
}

impl Margins {
    /// What the pad keeps from a point that not even it may touch: its margin to everything else, and
    /// as far as it works before its plane. \[m\]
    pub(crate) fn of_keep_out(&self, tool: &Tool) -> f64 {
        self.environment.max(tool.farthest())
    }
}

/// Whether the tool's pad may touch the scan: see the contact rule in the crate's documentation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolContact {
    /// The pad works on the surface.
    Allowed,
    /// The tool too keeps its margin: transfers.
    Forbidden,
}

/// Two things closer than their margin.
#[derive(Clone, Debug, PartialEq)]
pub struct Hit {
    /// The link (or tool, or attached object).
    pub link: String,
    /// What it is too near to.
    pub with: With,
    /// Their distance, negative for a point inside a shape. \[m\]
    pub distance: f64,
    /// The distance they should keep. \[m\]
    pub margin: f64,
}

/// The other side of a [`Hit`].
#[derive(Clone, Debug, PartialEq)]
pub enum With {
    /// Another link (or the tool, or an attached object).
    Link(String),
    /// A measured point, in the root frame. \[m\]
    ScanPoint(Point3<f64>),
    /// Space that no view has seen, at this place in the root frame. \[m\]
    Unseen(Point3<f64>),
    /// A point that not even the pad may touch, in the root frame. \[m\]
    KeepOut(Point3<f64>),
    /// An obstacle.
    Obstacle(String),
}

impl std::fmt::Display for Hit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (distance, margin) = (1e3 * self.distance, 1e3 * self.margin);
        write!(f, "{} is {distance:.1} mm from ", self.link)?;
        match &self.with {
            With::Link(name) => write!(f, "{name}")?,
            With::Obstacle(name) => write!(f, "obstacle {name}")?,
            With::ScanPoint(p) => write!(f, "scan point ({:.3}, {:.3}, {:.3})", p.x, p.y, p.z)?,
            With::KeepOut(p) => {
                write!(f, "a point to keep out of ({:.3}, {:.3}, {:.3})", p.x, p.y, p.z)?;
            }
            With::Unseen(p) => write!(f, "unseen space at ({:.3}, {:.3}, {:.3})", p.x, p.y, p.z)?,
        }
        write!(f, ", must keep {margin:.1} mm")
    }
}
