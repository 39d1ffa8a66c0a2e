//! The plan: what the planner makes, stores and publishes.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_ipc_types::{
    Contact, Interpolation, Knot, MAX_HELD_JOINTS, MAX_JOINTS, MAX_KNOTS, PlanHeader, PlanMessage,
    checksum,
};
use nullsweep_robot::{Arm, JointVector, MAX_DOF, Tool};
use serde::{Deserialize, Serialize};

use crate::plan::{CostKind, Curve, Method, Profile};

/// The version of the plan file that this build reads and writes.
pub const FORMAT: u32 = 1;

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
    /// The arm's joints, base to tip.
    pub joints: Vec<String>,
    /// The joints that the plan takes as fixed, in the URDF's order. \[rad\] or \[m\]
    pub held: Vec<Held>,
    /// The tool that it was made for.
    pub tool: Tool,
    /// The robot's root frame in the floor frame: x, y \[m\], yaw \[rad\].
    pub base: [f64; 3],
    /// How the order was found.
    pub method: Method,
    /// What was minimised.
    pub cost: CostKind,
    /// How fast it goes along its path, and so how the joints move between knots.
    #[serde(default)]
    pub profile: Profile,
    /// Seed of every random choice.
    pub seed: u64,
    /// The timed path.
    pub knots: Vec<PlanKnot>,
    /// Centres of the patches in the root frame, by the index that the knots use. \[m\]
    pub patches: Vec<[f64; 3]>,
    /// The scanned points that the plan is to sweep, in the root frame. \[m\]
    pub surface: Vec<SurfaceSample>,
    /// For a plan that goes on from another one: where.
    pub continues: Option<Continues>,
    /// What was followed before its first knot, oldest first: of each plan that led to this one the
    /// part up to where the next took over.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub past: Vec<Stretch>,
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

/// One knot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanKnot {
    /// Time since the plan's start. \[ns\]
    #[serde(rename = "t")]
    pub time_ns: u64,
    /// Joint vector, continuous joints unwrapped along the plan. \[rad\] or \[m\]
    pub q: JointVector,
    /// Joint velocities, of a plan with limited acceleration; else zero. \[rad/s\] or \[m/s\]
    #[serde(skip_serializing_if = "is_zero", default)]
    pub v: JointVector,
    /// The planned pad centre in the root frame while the pad is on the surface. \[m\]
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub line: Option<[f64; 3]>,
    /// The patch that is reached in this knot.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub patch: Option<u32>,
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

/// Why a plan file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not a plan.
    #[error("{path}: not a plan file: {source} (make one with `planner plan`)")]
    Parse {
        /// Which file.
        path: PathBuf,
        /// Line, column and cause.
        source: serde_json::Error,
    },
    /// Written by another version.
    #[error("{path}: plan format {found}, this build reads {FORMAT}: plan it again")]
    Format {
        /// Which file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// More knots than the wire takes.
    #[error(
        "the plan has {found} knots, the wire takes {MAX_KNOTS}: plan fewer patches at once (--crop)"
    )]
    TooLong {
        /// How many.
        found: usize,
    },
    /// More held joints than the wire takes.
    #[error("the robot has {found} other moving joints, the wire takes {MAX_HELD_JOINTS}")]
    TooManyHeld {
        /// How many.
        found: usize,
    },
}

impl Plan {
    /// Reads a plan file.
    ///
    /// # Errors
    /// Names the file and, for bad content, line and column.
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| PlanError::File { path: path.into(), source })?;
        let plan: Self = serde_json::from_str(&text)
            .map_err(|source| PlanError::Parse { path: path.into(), source })?;
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

    /// The robot's root frame in the floor frame.
    #[must_use]
    pub fn base_pose(&self) -> Isometry3<f64> {
        let [x, y, yaw] = self.base;
        Isometry3::new(Vector3::new(x, y, 0.0), Vector3::z() * yaw)
    }

    /// How long it takes. \[s\]
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time_ns as f64 * 1e-9)
    }

    /// The planned pad centre of each knot on the surface, root frame. \[m\]
    #[must_use]
    pub fn line(&self, knot: usize) -> Option<Point3<f64>> {
        self.knots.get(knot)?.line.map(Point3::from)
    }

    /// The motion that ends in a knot, as the executor interpolates it; a stand-still at the first
    /// one.
    #[must_use]
    pub fn curve(&self, knot: usize) -> Curve {
        let (a, b) = (&self.knots[knot.saturating_sub(1)], &self.knots[knot]);
        let seconds = b.time_ns.saturating_sub(a.time_ns) as f64 * 1e-9;
        match self.profile {
            Profile::Velocity => Curve::line(&a.q, &b.q, seconds),
            Profile::Acceleration => Curve::cubic((&a.q, &a.v), (&b.q, &b.v), seconds),
        }
    }

    /// All that has been followed when this plan has come to a knot: its past, and itself so far.
    #[must_use]
    pub fn followed(&self, knot: usize) -> Vec<Stretch> {
        let knots = self.knots[..self.knots.len().min(knot + 1)].to_vec();
        let last = Stretch { tool: self.tool.clone(), profile: self.profile, knots };
        self.past.iter().cloned().chain([last]).collect()
    }

    /// Whether the pad is on the surface in the segment that ends in a knot.
    #[must_use]
    pub fn on_surface(&self, knot: usize) -> bool {
        let before = self.line(knot.saturating_sub(1));
        before.is_some() && self.line(knot).is_some()
    }

    /// A checksum of what the executor is asked to do: the same for the same motion.
    #[must_use]
    pub fn digest(&self) -> u64 {
        self.message_parts().map_or(0, |(header, _)| header.checksum)
    }

    /// The plan as it goes over the wire, without id and join rule, its checksum set.
    ///
    /// # Errors
    /// [`PlanError::TooLong`] and [`PlanError::TooManyHeld`].
    pub fn message_parts(&self) -> Result<(PlanHeader, Vec<Knot>), PlanError> {
        if self.knots.len() > MAX_KNOTS {
            return Err(PlanError::TooLong { found: self.knots.len() });
        }
        if self.held.len() > MAX_HELD_JOINTS {
            return Err(PlanError::TooManyHeld { found: self.held.len() });
        }
        let knots: Vec<Knot> =
            (0..self.knots.len()).map(|k| self.knots[k].wire(self.on_surface(k))).collect();
        let pose = self.base_pose();
        let (t, r) = (pose.translation.vector, pose.rotation.coords);
        let tool = serde_json::to_vec(&self.tool).unwrap_or_default();
        let mut header = PlanHeader {
            fingerprint: self.fingerprint,
            tool: xxhash_rust::xxh3::xxh3_64(&tool),
            base_pose: [t.x, t.y, t.z, r.x, r.y, r.z, r.w],
            held_count: self.held.len() as u32,
            joint_count: self.joints.len() as u32,
            knot_count: knots.len() as u32,
            interpolation: match self.profile {
                Profile::Velocity => Interpolation::Linear.wire(),
                Profile::Acceleration => Interpolation::Cubic.wire(),
            },
            ..PlanHeader::default()
        };
        for (slot, held) in header.held_positions.iter_mut().zip(&self.held) {
            *slot = held.position;
        }
        header.checksum = checksum(PlanMessage { header: &header, knots: &knots });
        Ok((header, knots))
    }
}

impl PlanKnot {
    fn wire(&self, on_surface: bool) -> Knot {
        let mut positions = [0.0; MAX_JOINTS];
        positions[..MAX_DOF].copy_from_slice(&self.q[..]);
        let mut velocities = [0.0; MAX_JOINTS];
        velocities[..MAX_DOF].copy_from_slice(&self.v[..]);
        let contact = if on_surface { Contact::Contact } else { Contact::Transfer };
        Knot {
            time_from_start_ns: self.time_ns,
            positions,
            velocities,
            patch: self.patch.unwrap_or(Knot::NO_PATCH),
            contact: contact.wire(),
        }
    }
}

fn is_zero(v: &JointVector) -> bool {
    *v == JointVector::default()
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
