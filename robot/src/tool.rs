//! The tool that touches the surface: a rectangular pad at the end of the arm.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::joints::JointVector;

/// A rectangular pad (sponge, brush, squeegee) and how it sits on the arm's tip frame.
///
/// Its *contact frame* has the pad's centre as origin, x along the direction of travel, z into
/// the surface (against the surface normal) and y = z × x along the pad's long side, so that the
/// pad moves across its long side (paper §I).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// For people.
    pub name: String,
    /// Long side of the pad, across the travel, the contact frame's y. \[m\]
    pub length: f64,
    /// Short side of the pad, along the travel, the contact frame's x. \[m\]
    pub width: f64,
    /// Height of the pad's body, from the surface back towards the arm. \[m\]
    pub thickness: f64,
    /// Centre of the pad in the arm's tip frame. \[m\]
    pub centre: [f64; 3],
    /// The tip frame's axis that points into the surface.
    pub approach: [f64; 3],
    /// The tip frame's axis along the pad's long side.
    pub across: [f64; 3],
    /// Distance kept between pad centre and surface, along the normal. \[m\]
    pub stand_off: f64,
    /// How far the pad's soft body may be pressed in, along its axis, anywhere in its rectangle. \[m\]
    #[serde(default = "default_press_max")]
    pub press_max: f64,
    /// Whether a heading and its opposite are the same contact.
    pub symmetric: bool,
    /// A point is swept within this distance of the pad's plane. \[m\]
    pub reach_normal: f64,
    /// A point is swept if its normal is within this angle of the pad's. \[rad\]
    pub reach_angle: f64,
}

/// Of a tool file that does not say it: a third of the default sponge. \[m\]
fn default_press_max() -> f64 {
    0.010
}

impl Default for Tool {
    /// The sponge of 0.10 × 0.07 m in the PR2's gripper: pad centre 0.03 m ahead of the gripper's
    /// tool frame along its x axis, which points into the surface.
    fn default() -> Self {
        Self {
            name: "sponge".into(),
            length: 0.10,
            width: 0.07,
            thickness: 0.03,
            centre: [0.03, 0.0, 0.0],
            approach: [1.0, 0.0, 0.0],
            across: [0.0, 1.0, 0.0],
            stand_off: 0.0,
            press_max: default_press_max(),
            symmetric: true,
            reach_normal: 0.010,
            reach_angle: 30f64.to_radians(),
        }
    }
}

impl Tool {
    /// The pose of the contact frame in the arm's tip frame.
    #[must_use]
    pub fn contact_in_tip(&self) -> Isometry3<f64> {
        let z = Vector3::from(self.approach).normalize();
        let across = Vector3::from(self.across);
        let y = (across - z * across.dot(&z)).normalize();
        let rotation =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[y.cross(&z), y, z]));
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.centre)),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }

    /// The tool at the tip of an arm.
    #[must_use]
    pub fn on<'a>(&self, arm: &'a Arm) -> Mounted<'a> {
        Mounted { arm, contact_in_tip: self.contact_in_tip() }
    }
}

/// A tool at the tip of an arm: where its contact frame is.
#[derive(Clone, Copy)]
pub struct Mounted<'a> {
    arm: &'a Arm,
    contact_in_tip: Isometry3<f64>,
}

impl Mounted<'_> {
    /// Pose of the contact frame in the root frame.
    #[must_use]
    #[inline]
    pub fn pose(&self, q: &JointVector) -> Isometry3<f64> {
        self.arm.tip_pose(q) * self.contact_in_tip
    }

    /// The pad's centre in the root frame. \[m\]
    #[must_use]
    #[inline]
    pub fn centre(&self, q: &JointVector) -> Point3<f64> {
        Point3::from(self.pose(q).translation.vector)
    }
}
