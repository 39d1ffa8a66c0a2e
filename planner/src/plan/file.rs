//! The plan: what the planner makes, stores and publishes.

use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, JointVector, MAX_DOF, Robot, Tool};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

use super::curve::Curve;
use super::error::{FORMAT, PlanError};
use super::kind::is_program;
use super::knot::PlanKnot;
use super::seal::Seal;
use super::settings::{CostKind, Method, Profile};
use super::trajectory::Trajectory;
use crate::regions::Mark;

/// A timed joint path that sweeps a surface, with everything needed to check and to publish it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// [`FORMAT`].
    pub format: u32,
    /// The robot's name in its URDF.
    pub robot: String,
    /// Fingerprint of robot and arm. Hexadecimal in the file: JSON numbers lose 64 bits.
    #[serde(with = "hex")]
    pub fingerprint: u64,
    /// The arm's joints, base to tip; in a file 1 to [`MAX_DOF`].
    #[serde(deserialize_with = "joints")]
    pub joints: Vec<String>,
    /// The joints that the plan takes as fixed, in the URDF's order. \[rad\] or \[m\]
    pub held: Vec<Held>,
    /// The tool that it was made for.
    pub tool: Tool,
    /// The robot's root frame in the floor frame: x, y \[m\], yaw \[rad\].
    pub base: [f64; 3],
    /// How high above the floor the root frame is: a stand's height. \[m\]
    #[serde(default, skip_serializing_if = "is_zero")]
    pub base_height: f64,
    /// How the order was found.
    pub method: Method,
    /// What was minimised.
    pub cost: CostKind,
    /// How fast it goes along its path, and so how the joints move between knots.
    #[serde(default)]
    pub profile: Profile,
    /// The jerk that it keeps each joint within, if any. \[rad/s³\] or \[m/s³\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jerk: Option<JointVector>,
    /// Seed of every random choice.
    pub seed: u64,
    /// The timed path.
    pub knots: Vec<PlanKnot>,
    /// Centres of the patches in the root frame, by the index that the knots use. \[m\]
    pub patches: Vec<[f64; 3]>,
    /// The scanned points that the plan is to sweep, in the root frame. \[m\]
    pub surface: Vec<SurfaceSample>,
    /// The regions that it was made for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub regions: Vec<Mark>,
    /// For a plan that goes on from another one: where.
    pub continues: Option<Continues>,
    /// What was followed before its first knot, oldest first: of each plan that led to this one the
    /// part up to where the next took over.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub past: Vec<Stretch>,
    /// What it leaves, by cause, as was found when it was made.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left: Vec<Left>,
    /// What it was like when it was verified, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seal: Option<Seal>,
}

/// What one cause keeps a plan from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Left {
    /// The cause, in words.
    pub cause: String,
    /// The points of the surface, or the given poses, by their index.
    pub points: Vec<u32>,
}

/// A part of a plan that was followed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stretch {
    /// The tool that it was followed with.
    pub tool: Tool,
    /// How the joints moved between knots.
    pub profile: Profile,
    /// Its knots.
    pub knots: Vec<PlanKnot>,
}

/// A joint that the plan takes as fixed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// Its name in the URDF.
    pub name: String,
    /// Where it stands. \[rad\] or \[m\]
    pub position: f64,
}

impl Stretch {
    /// The timed path through its knots.
    #[must_use]
    pub fn trajectory(&self) -> Trajectory<'_> {
        Trajectory { tool: &self.tool, profile: self.profile, knots: &self.knots }
    }
}

impl Held {
    /// Every held joint of an arm, in the order of its URDF.
    #[must_use]
    pub fn all_of(arm: &Arm) -> Vec<Self> {
        let held = arm.held_joints().iter();
        held.map(|h| Self { name: h.name.clone(), position: h.position }).collect()
    }
}

/// A scanned point with what is known of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceSample {
    /// Position in the root frame. \[m\]
    #[serde(rename = "p")]
    pub point: [f64; 3],
    /// Unit normal in the root frame.
    #[serde(rename = "n")]
    pub normal: [f64; 3],
    /// Whether it belongs to a reachable patch.
    #[serde(rename = "r")]
    pub reachable: bool,
}

/// The knot of another plan in which a plan starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Continues {
    /// Checksum of the other plan's knots, see [`Plan::digest`].
    #[serde(with = "hex")]
    pub digest: u64,
    /// The knot.
    pub knot: u32,
}

impl Plan {
    /// Whether it takes over from another plan in passing: what the joints did before is then that
    /// one's, else the arm was at rest.
    #[must_use]
    pub fn begins_in_motion(&self) -> bool {
        let first = self.knots.first();
        self.continues.is_some()
            && (self.profile == Profile::Velocity
                || first.is_some_and(|k| k.v != JointVector::ZERO))
    }

    /// A bang-bang plan through these knots, base and root frame in one place, of no patch and no
    /// scan: what else it is made for is filled in by who makes it.
    #[must_use]
    pub fn of(robot: &Robot, arm: &Arm, tool: &Tool, knots: Vec<PlanKnot>) -> Self {
        Self {
            format: FORMAT,
            robot: robot.name().into(),
            fingerprint: arm.fingerprint(),
            joints: arm.joint_names().to_vec(),
            held: Held::all_of(arm),
            tool: tool.clone(),
            base: [0.0; 3],
            base_height: 0.0,
            method: Method::Tsp,
            cost: CostKind::Effort,
            profile: Profile::Velocity,
            jerk: None,
            seed: 0,
            knots,
            patches: Vec::new(),
            surface: Vec::new(),
            regions: Vec::new(),
            continues: None,
            past: Vec::new(),
            left: Vec::new(),
            seal: None,
        }
    }

    /// Reads a plan file.
    ///
    /// # Errors
    /// Names the file and, for bad content, line and column.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let text = std::fs::read_to_string(path).map_err(|source| match source.kind() {
            std::io::ErrorKind::InvalidData => PlanError::NoText { path: path.into() },
            _ => PlanError::File { path: path.into(), source },
        })?;
        Self::parse(&text, path)
    }

    /// Reads a plan from the text of its file; `path` is only used to name it in errors.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, PlanError> {
        let plan: Self = serde_json::from_str(text).map_err(|source| {
            let path = path.into();
            if is_program(text) {
                PlanError::IsProgram { path }
            } else {
                PlanError::Parse { path, source }
            }
        })?;
        if plan.format == FORMAT {
            Ok(plan)
        } else {
            Err(PlanError::Format { path: path.into(), found: plan.format })
        }
    }

    /// Writes a plan file; the same plan gives the same bytes.
    ///
    /// # Errors
    /// Names the file.
    pub fn write(&self, path: &Path) -> Result<(), PlanError> {
        let file = |source| PlanError::File { path: path.into(), source };
        let text = serde_json::to_string(self).map_err(|e| file(e.into()))?;
        std::fs::write(path, text).map_err(file)
    }

    /// The plan, said to be verified as it is.
    #[must_use]
    pub fn sealed(self) -> Self {
        let seal = Some(self.seal_now());
        Self { seal, ..self }
    }

    /// Whether it is as it was verified.
    ///
    /// # Errors
    /// [`PlanError::Unverified`], or where it was changed: [`PlanError::KnotChanged`],
    /// [`PlanError::Changed`].
    pub fn check_seal(&self) -> Result<(), PlanError> {
        self.seal.as_ref().ok_or(PlanError::Unverified)?.check(&self.seal_now())
    }

    fn seal_now(&self) -> Seal {
        Seal::new(&self.knots, &Self { knots: Vec::new(), seal: None, ..self.clone() })
    }

    /// The robot's root frame in the floor frame.
    #[must_use]
    pub fn base_pose(&self) -> Isometry3<f64> {
        let [x, y, yaw] = self.base;
        Isometry3::new(Vector3::new(x, y, self.base_height), Vector3::z() * yaw)
    }

    /// How long it takes. \[s\]
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time_ns as f64 * 1e-9)
    }

    /// The timed path through its knots.
    #[must_use]
    pub fn trajectory(&self) -> Trajectory<'_> {
        Trajectory { tool: &self.tool, profile: self.profile, knots: &self.knots }
    }

    /// See [`Trajectory::line`].
    #[must_use]
    pub fn line(&self, knot: usize) -> Option<Point3<f64>> {
        self.trajectory().line(knot)
    }

    /// See [`Trajectory::curve`].
    #[must_use]
    pub fn curve(&self, knot: usize) -> Curve {
        self.trajectory().curve(knot)
    }

    /// See [`Trajectory::on_surface`].
    #[must_use]
    pub fn on_surface(&self, knot: usize) -> bool {
        self.trajectory().on_surface(knot)
    }

    /// All that has been followed when this plan has come to a knot: its past, and itself so far.
    #[must_use]
    pub fn followed(&self, knot: usize) -> Vec<Stretch> {
        let knots = self.knots[..self.knots.len().min(knot + 1)].to_vec();
        let last = Stretch { tool: self.tool.clone(), profile: self.profile, knots };
        self.past.iter().cloned().chain([last]).collect()
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// As many names as a joint vector has lanes, or fewer.
fn joints<'de, D: Deserializer<'de>>(input: D) -> Result<Vec<String>, D::Error> {
    let names = Vec::<String>::deserialize(input)?;
    if (1..=MAX_DOF).contains(&names.len()) {
        Ok(names)
    } else {
        Err(D::Error::custom(format!("{} joints: 1 to {MAX_DOF} are wanted", names.len())))
    }
}

/// 64-bit numbers as hexadecimal strings.
mod hex {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &u64, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(&format!("{value:016x}"))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<u64, D::Error> {
        let text = String::deserialize(input)?;
        u64::from_str_radix(&text, 16).map_err(D::Error::custom)
    }
}
