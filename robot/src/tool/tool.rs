//! A tool, and where it sits on the arm.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use super::error::ToolError;
use super::footprint::{Camera, Footprint, Nozzle, Roller};
use crate::arm::Arm;
use crate::joints::JointVector;

/// A pad (sponge, brush, squeegee), roller, nozzle or camera, and how it sits on the arm's tip frame.
/// What is said of a pad here holds for the others as [`Footprint`] says.
///
/// Its *contact frame* has the pad's centre as origin, x along the direction of travel, z into
/// the surface (against the surface normal) and y = z × x along the pad's long side, so that the
/// pad moves across its long side (paper §I).
///
/// **What is swept.** A point of the surface is swept where it lies in the pad's rectangle, within
/// `reach_normal` of the plane that is `stand_off` ahead of the pad's, and faces the pad to within
/// `reach_angle`. Wiping needs contact: of a pad that is pressed in (`stand_off` below 0) these two
/// say how deep its soft body is pressed and how far before its plane it still touches, which is
/// [`Tool::hover`]; a sponge pressed in by 4 mm with
/// 8 mm of reach touches to 4 mm before its plane, which is what a depth camera is uncertain by two
/// metres away. A tool that works from afar stands off.
///
/// A nozzle or camera has its mouth or lens at the contact frame's origin, `stand_off` before the
/// surface; a camera sweeps what it sees, a nozzle what it lays enough onto and not too much.
///
/// One that is read from a file has passed [`Tool::check`].
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// For people.
    pub name: String,
    /// Long side of the pad, or of the body of what works from afar, across the travel, the contact
    /// frame's y. \[m\]
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
    /// Distance kept between pad centre and surface, along the normal; below 0 the pad is pressed in
    /// so far. \[m\]
    pub stand_off: f64,
    /// How far the pad's soft body may be pressed in, along its axis, anywhere in its rectangle; a
    /// third of its thickness where a file does not say it. \[m\]
    pub press_max: f64,
    /// Whether a heading and its opposite are the same contact.
    pub symmetric: bool,
    /// A point is swept within this distance of the plane `stand_off` ahead of the pad's. \[m\]
    pub reach_normal: f64,
    /// A point is swept if its normal is within this angle of the pad's. \[rad\]
    pub reach_angle: f64,
    /// What it is a tool for.
    pub footprint: Footprint,
}

impl Default for Tool {
    /// The sponge of 0.10 × 0.07 m in the PR2's gripper: pad centre 0.03 m ahead of the gripper's
    /// tool frame along its x axis, which points into the surface. It is pressed in by 4 mm and gives
    /// way by 10.
    fn default() -> Self {
        Self {
            name: "sponge".into(),
            length: 0.10,
            width: 0.07,
            thickness: 0.03,
            centre: [0.03, 0.0, 0.0],
            approach: [1.0, 0.0, 0.0],
            across: [0.0, 1.0, 0.0],
            stand_off: -0.004,
            press_max: 0.010,
            symmetric: true,
            reach_normal: 0.008,
            reach_angle: 30f64.to_radians(),
            footprint: Footprint::Rectangle,
        }
    }
}

/// Sides of a pad, least and greatest. \[m\]
const SIDE: (f64, f64) = (1e-4, 10.0);
/// Farthest from the tip frame, and from the surface. \[m\]
const FAR: f64 = 10.0;
/// Half of the opening angle of what works from afar, least and greatest. \[rad\]
const OPENING: (f64, f64) = (0.01, 1.3);
/// Least sine of the angle between two axes that span a plane.
const SPREAD: f64 = 0.01;

impl Tool {
    /// Whether there can be such a tool: a pad with sides, near the tip, with two axes.
    ///
    /// # Errors
    /// The first field that is out of its range.
    pub fn check(&self) -> Result<(), ToolError> {
        self.check_footprint()?;
        let [x, y, z] = self.centre;
        for (field, value, unit, (low, high)) in [
            ("length", self.length, "m", SIDE),
            ("width", self.width, "m", SIDE),
            ("thickness", self.thickness, "m", SIDE),
            ("centre[0]", x, "m", (-FAR, FAR)),
            ("centre[1]", y, "m", (-FAR, FAR)),
            ("centre[2]", z, "m", (-FAR, FAR)),
            ("stand_off", self.stand_off, "m", (-FAR, FAR)),
            ("press_max", self.press_max, "m", (0.0, self.thickness)),
            ("reach_normal", self.reach_normal, "m", (0.0, FAR)),
            ("reach_angle", self.reach_angle, "rad", (0.0, PI)),
        ] {
            if !(low..=high).contains(&value) {
                return Err(ToolError::Range { field, value, unit, low, high });
            }
        }
        let (approach, across) = (self.approach, self.across);
        let direction = |field, axis: [f64; 3]| {
            Unit::try_new(Vector3::from(axis), 1e-6)
                // Beyond 1e154 a norm overflows, and nothing is left of the direction.
                .filter(|unit| (unit.norm() - 1.0).abs() < 1e-6)
                .ok_or(ToolError::Axis { field, axis })
        };
        let (into, along) = (direction("approach", approach)?, direction("across", across)?);
        if into.cross(&along).norm() < SPREAD {
            return Err(ToolError::Parallel { approach, across });
        }
        Ok(())
    }

    /// Whether the numbers that only some shapes have can be.
    fn check_footprint(&self) -> Result<(), ToolError> {
        let range = |field, value: f64, unit, (low, high): (f64, f64)| {
            let is_inside = (low..=high).contains(&value);
            is_inside.then_some(()).ok_or(ToolError::Range { field, value, unit, low, high })
        };
        let order = |field, [low, high]: [f64; 2], unit| {
            let is_ordered = low < high;
            is_ordered.then_some(()).ok_or(ToolError::Order { field, low, high, unit })
        };
        let afar = |distance: [f64; 2]| {
            range("distance[0]", distance[0], "m", SIDE)?;
            range("distance[1]", distance[1], "m", SIDE)?;
            order("distance", distance, "m")?;
            range("stand_off", self.stand_off, "m", (distance[0], distance[1]))
        };
        match &self.footprint {
            Footprint::Rectangle | Footprint::Disc => Ok(()),
            Footprint::Roller(Roller { radius, slip_max }) => {
                range("radius", *radius, "m", SIDE)?;
                range("width", self.width, "m", (SIDE.0, 2.0 * radius))?;
                range("press_max", self.press_max, "m", (0.0, *radius))?;
                range("slip_max", *slip_max, "rad", (0.0, FRAC_PI_2))
            }
            Footprint::Nozzle(Nozzle { distance, cone, rate, deposit }) => {
                afar(*distance)?;
                range("cone", *cone, "rad", OPENING)?;
                range("rate", *rate, "m³/s", (1e-12, 1.0))?;
                range("deposit[0]", deposit[0], "m", (1e-9, SIDE.1))?;
                range("deposit[1]", deposit[1], "m", (1e-9, SIDE.1))?;
                order("deposit", *deposit, "m")
            }
            Footprint::Camera(Camera { distance, field_of_view }) => {
                afar(*distance)?;
                let (low, high) = (2.0 * OPENING.0, 2.0 * OPENING.1);
                range("field_of_view[0]", field_of_view[0], "rad", (low, high))?;
                range("field_of_view[1]", field_of_view[1], "rad", (low, high))
            }
        }
    }

    /// How far before the pad's plane a point may lie and be swept; 0 where it must be pressed in. \[m\]
    #[must_use]
    pub fn hover(&self) -> f64 {
        (self.stand_off + self.reach_normal).max(0.0)
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    type Spoil = fn(&mut Tool);

    #[test]
    fn a_tool_that_cannot_be_is_refused_by_its_field() {
        let spoil: [(&str, Spoil); 15] = [
            ("length is 0 m", |t| t.length = 0.0),
            ("width is NaN m", |t| t.width = f64::NAN),
            ("thickness is -0.03 m", |t| t.thickness = -0.03),
            ("width is inf m", |t| t.width = f64::INFINITY),
            ("width is 0.00000000000000000001 m", |t| t.width = 1e-20),
            ("centre[1] is NaN m", |t| t.centre[1] = f64::NAN),
            ("stand_off is -inf m", |t| t.stand_off = f64::NEG_INFINITY),
            ("press_max is 0.031 m", |t| t.press_max = 0.031),
            ("reach_normal is -1 m", |t| t.reach_normal = -1.0),
            ("reach_angle is 4 rad", |t| t.reach_angle = 4.0),
            ("approach is [0.0, 0.0, 0.0]", |t| t.approach = [0.0; 3]),
            ("across is [NaN, 1.0, 0.0]", |t| t.across[0] = f64::NAN),
            ("across is [1e300, 1e300, 0.0]", |t| t.across = [1e300, 1e300, 0.0]),
            ("are parallel", |t| t.across = [-2.0, 0.0, 0.0]),
            ("are parallel", |t| t.across = [1.0, 0.001, 0.0]),
        ];
        for (says, spoil) in spoil {
            let mut tool = Tool::default();
            assert_eq!(tool.check(), Ok(()));
            spoil(&mut tool);
            let said = tool.check().expect_err(says).to_string();
            assert!(said.contains(says), "{said}");
        }
    }
}
