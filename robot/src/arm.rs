//! An arm of a robot: a serial chain with limits, poses, Jacobian and inverse kinematics.

use std::sync::Arc;

use nalgebra::{Isometry3, SMatrix};

use crate::chain::{Chain, Step, about};
use crate::fingerprint::fingerprint;
use crate::ik::{InverseKinematics, RedundantJoint, Solvers};
use crate::limits::{JointLimits, LimitsError, apply_toml};
use crate::urdf::{Joint, JointKind, Model, Robot};
use crate::{JointVector, MAX_DOF, pr2};

/// Geometric Jacobian: rows linear x, y, z [m/s], angular x, y, z [rad/s] of the tip in the root
/// frame; one column a joint, unused columns zero.
pub type Jacobian = SMatrix<f64, 6, MAX_DOF>;

/// Which part of a robot is the arm: the movable joints between two links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArmSpec {
    /// Link that carries the arm.
    pub base: String,
    /// Link whose frame is the tip.
    pub tip: String,
}

/// A movable joint of the robot that the arm does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    /// Name of the joint.
    pub name: String,
    /// Where it is held. [rad or m]
    pub position: f64,
}

/// Why an arm could not be made or changed.
#[derive(Debug, thiserror::Error)]
pub enum ArmError {
    /// The link is not in the URDF.
    #[error("no link {link} in robot {robot}; its links are: {}", known.join(", "))]
    UnknownLink {
        /// The link.
        link: String,
        /// The robot.
        robot: String,
        /// The links that there are.
        known: Vec<String>,
    },
    /// The tip does not hang on the base.
    #[error("link {tip} does not hang on link {base}: choose a base between the root and the tip")]
    NotAChain {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// Nothing moves.
    #[error("no joint moves between {base} and {tip}")]
    NoJoints {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// Too much moves.
    #[error(
        "{} joints move between the links ({}), at most {MAX_DOF} are supported: choose a base nearer to the tip",
        joints.len(),
        joints.join(", ")
    )]
    TooManyJoints {
        /// The joints.
        joints: Vec<String>,
    },
    /// A joint of the arm follows another joint.
    #[error("joint {joint} of the arm mimics another joint: parallel linkages are not supported")]
    MimicInChain {
        /// The joint.
        joint: String,
    },
    /// A joint of the arm has no usable limits.
    #[error(
        "joint {joint} of the arm has no usable <limit>: a velocity above 0 and, unless it is continuous, lower < upper are needed"
    )]
    NoLimits {
        /// The joint.
        joint: String,
    },
    /// A held joint that is not there.
    #[error("{joint} is not held by this arm; held are: {}", known.join(", "))]
    NotHeld {
        /// The joint.
        joint: String,
        /// The held joints.
        known: Vec<String>,
    },
    /// A position for a held joint outside its limits.
    #[error("{joint} cannot be held at {position}: its range is {lower} … {upper}")]
    HeldOutside {
        /// The joint.
        joint: String,
        /// The position. [rad or m]
        position: f64,
        /// Lower hard limit.
        lower: f64,
        /// Upper hard limit.
        upper: f64,
    },
}

/// A serial arm with all other joints of the robot held.
///
/// Immutable and shareable between threads; [`Arm::with_held`] makes a changed copy.
#[derive(Clone)]
pub struct Arm {
    model: Arc<Model>,
    spec: ArmSpec,
    fingerprint: u64,
    names: Vec<String>,
    limits: Vec<JointLimits>,
    margined: Vec<(f64, f64)>,
    held: Vec<HeldJoint>,
    chain: Chain,
    moving: Vec<usize>,
    /// How each link follows from its parent, parents first.
    placements: Vec<Placement>,
    solvers: Solvers,
}

/// A link's pose from its parent's.
#[derive(Clone)]
struct Placement {
    link: usize,
    parent: usize,
    /// Fixed part, with the motion of held joints in it.
    local: Isometry3<f64>,
    motion: Motion,
}

#[derive(Clone)]
enum Motion {
    /// Does not move with the arm: `local` is the pose in the root frame.
    Static,
    /// Fixed to a link that moves.
    Carried,
    /// Moves by factor · q[joint] + offset about or along an axis.
    Joint { axis: nalgebra::Vector3<f64>, prismatic: bool, source: usize, factor: f64, offset: f64 },
}

impl Robot {
    /// The arm between two links.
    ///
    /// All other movable joints are held: at zero moved into their limits, but the PR2's other arm
    /// out of the way at the robot's side. [`Arm::with_held`] holds them elsewhere.
    ///
    /// # Errors
    /// When the links are not there, the chain is not a serial one of 1 to 8 joints, or a joint of
    /// it has no limits.
    pub fn arm(&self, spec: &ArmSpec) -> Result<Arm, ArmError> {
        let model = &self.model;
        let active = active_joints(self, spec)?;
        let mut limits = Vec::with_capacity(active.len());
        for &index in &active {
            let joint = &model.joints[index];
            limits.push(
                JointLimits::of(joint)
                    .ok_or_else(|| ArmError::NoLimits { joint: joint.name.clone() })?,
            );
        }
        let held = model
            .joints
            .iter()
            .enumerate()
            .filter(|(i, joint)| joint.is_independent() && !active.contains(i))
            .map(|(_, joint)| HeldJoint { name: joint.name.clone(), position: rest(joint) })
            .collect();
        Ok(Arm::assemble(model.clone(), spec.clone(), &active, limits, held))
    }
}

impl Arm {
    /// Number of joints that the arm moves, 1 to [`MAX_DOF`].
    #[must_use]
    pub fn dof(&self) -> usize {
        self.names.len()
    }

    /// Names of the joints in chain order.
    #[must_use]
    pub fn joint_names(&self) -> &[String] {
        &self.names
    }

    /// Base and tip.
    #[must_use]
    pub fn spec(&self) -> &ArmSpec {
        &self.spec
    }

    /// The robot that the arm belongs to.
    #[must_use]
    pub fn robot(&self) -> Robot {
        Robot { model: self.model.clone() }
    }

    /// Limits in chain order.
    #[must_use]
    pub fn limits(&self) -> &[JointLimits] {
        &self.limits
    }

    /// Every other movable joint of the robot that follows no other, in the order of the URDF.
    #[must_use]
    pub fn held_joints(&self) -> &[HeldJoint] {
        &self.held
    }

    /// The same arm with other joints held elsewhere, for example `torso_lift_joint`.
    ///
    /// # Errors
    /// When a joint is not among the held ones or its position is outside its limits.
    pub fn with_held(&self, values: &[(&str, f64)]) -> Result<Self, ArmError> {
        let mut held = self.held.clone();
        for &(name, position) in values {
            let Some(slot) = held.iter_mut().find(|h| h.name == name) else {
                let known = self.held.iter().map(|h| h.name.clone()).collect();
                return Err(ArmError::NotHeld { joint: name.to_owned(), known });
            };
            let limits = self.model.joints.iter().find(|j| j.name == name).and_then(|j| j.limits);
            let (lower, upper) =
                limits.map_or((f64::NEG_INFINITY, f64::INFINITY), |l| (l.lower, l.upper));
            // An encoder may read a little past a stop.
            let slack = 0.02;
            if !(position >= lower - slack && position <= upper + slack && position.is_finite()) {
                let joint = name.to_owned();
                return Err(ArmError::HeldOutside { joint, position, lower, upper });
            }
            slot.position = position;
        }
        Ok(self.changed(self.limits.clone(), held))
    }

    /// The same arm with limits from a file: one table a joint with `velocity` (at most the
    /// URDF's), `acceleration`, or both.
    ///
    /// ```toml
    /// [r_wrist_flex_joint]
    /// velocity = 2.0       # rad/s
    /// acceleration = 10.0  # rad/s²
    /// ```
    ///
    /// # Errors
    /// When the text is not such a file, names a joint that the arm does not move, or holds a
    /// value out of range.
    pub fn with_limits_toml(&self, text: &str) -> Result<Self, LimitsError> {
        let mut limits = self.limits.clone();
        apply_toml(text, &self.names, &mut limits)?;
        Ok(self.changed(limits, self.held.clone()))
    }

    /// 64 bits that name the robot's kinematics and this arm, whatever the held positions.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// Pose of the tip in the root frame.
    #[must_use]
    #[inline]
    pub fn tip_pose(&self, q: &JointVector) -> Isometry3<f64> {
        self.chain.tip_pose(q)
    }

    /// Poses of all links of the robot in the root frame, by link index.
    ///
    /// # Panics
    /// When `out` is shorter than the robot has links.
    pub fn link_poses(&self, q: &JointVector, out: &mut [Isometry3<f64>]) {
        for Placement { link, parent, local, motion } in &self.placements {
            out[*link] = match motion {
                Motion::Static => *local,
                Motion::Carried => out[*parent] * local,
                Motion::Joint { axis, prismatic, source, factor, offset } => {
                    let value = factor * q[*source] + offset;
                    out[*parent] * local * motion_of(axis, *prismatic, value)
                }
            };
        }
    }

    /// Links that move with the arm, base to tip, with those that are fixed to them.
    #[must_use]
    pub fn moving_links(&self) -> &[usize] {
        &self.moving
    }

    /// Geometric Jacobian of the tip in the root frame.
    #[must_use]
    pub fn jacobian(&self, q: &JointVector) -> Jacobian {
        self.chain.jacobian(q).1
    }

    /// The soft limits of a joint moved in by |velocity| / k_position: where the arm may be at
    /// that speed. The one rule of planner and executor; see [`JointLimits::braking`].
    #[must_use]
    pub fn braking_limits(&self, joint: usize, velocity: f64) -> (f64, f64) {
        self.limits[joint].braking(velocity)
    }

    /// [`Arm::braking_limits`] of each joint at its largest speed.
    #[must_use]
    pub fn margined_limits(&self) -> &[(f64, f64)] {
        &self.margined
    }

    /// Whether each joint is inside its margined limits.
    #[must_use]
    #[inline]
    pub fn within_margins(&self, q: &JointVector) -> bool {
        self.margined.iter().zip(q).all(|((lower, upper), q)| lower <= q && q <= upper)
    }

    /// A posture to begin from: the PR2's arm ready in front of the robot; for other arms the
    /// middle of each range and 0 for continuous joints.
    #[must_use]
    pub fn home(&self) -> JointVector {
        let mut home = [0.0; MAX_DOF];
        for (i, name) in self.names.iter().enumerate() {
            let (lower, upper) = self.margined[i];
            let middle = if lower.is_finite() { 0.5 * (lower + upper) } else { 0.0 };
            home[i] = pr2::ready(name).filter(|_| self.is_pr2()).unwrap_or(middle);
        }
        home
    }

    /// Inverse kinematics: in closed form for an arm of the PR2's shape with the upper-arm roll
    /// as redundancy, numeric otherwise.
    #[must_use]
    pub fn ik(&self) -> &dyn InverseKinematics {
        self.solvers.default()
    }

    /// Inverse kinematics with another joint as redundancy, where there is one.
    #[must_use]
    pub fn ik_by(&self, joint: RedundantJoint) -> Option<&dyn InverseKinematics> {
        self.solvers.by(joint)
    }

    /// Same kinematics as the PR2's and its joint names.
    fn is_pr2(&self) -> bool {
        self.solvers.closed_form() && self.names.iter().all(|n| pr2::ready(n).is_some())
    }

    fn changed(&self, limits: Vec<JointLimits>, held: Vec<HeldJoint>) -> Self {
        let index = |name: &String| self.model.joints.iter().position(|j| j.name == *name);
        let active: Vec<usize> = self.names.iter().filter_map(index).collect();
        Self::assemble(self.model.clone(), self.spec.clone(), &active, limits, held)
    }

    fn assemble(
        model: Arc<Model>,
        spec: ArmSpec,
        active: &[usize],
        limits: Vec<JointLimits>,
        held: Vec<HeldJoint>,
    ) -> Self {
        let tip = model.links.iter().position(|l| l.name == spec.tip).unwrap_or(model.root);
        let values = Values { model: &model, active, held: &held };
        let chain = build_chain(&values, tip);
        let (placements, moving) = build_placements(&values);
        let margined: Vec<_> = limits.iter().map(|l| l.braking(l.velocity)).collect();
        Self {
            fingerprint: fingerprint(&model, &spec),
            names: active.iter().map(|&j| model.joints[j].name.clone()).collect(),
            solvers: Solvers::new(&chain, &limits, &margined),
            spec,
            limits,
            margined,
            chain,
            moving,
            placements,
            held,
            model,
        }
    }
}

/// The independent joints from base to tip.
fn active_joints(robot: &Robot, spec: &ArmSpec) -> Result<Vec<usize>, ArmError> {
    let model = &robot.model;
    let find = |name: &str| {
        robot.link_index(name).ok_or_else(|| ArmError::UnknownLink {
            link: name.to_owned(),
            robot: model.name.clone(),
            known: model.links.iter().map(|l| l.name.clone()).collect(),
        })
    };
    let (base, tip) = (find(&spec.base)?, find(&spec.tip)?);
    let (base_name, tip_name) = (spec.base.clone(), spec.tip.clone());
    let mut active = Vec::new();
    let mut link = tip;
    while link != base {
        let Some(index) = model.links[link].parent_joint else {
            return Err(ArmError::NotAChain { base: base_name, tip: tip_name });
        };
        let joint = &model.joints[index];
        if joint.mimic.is_some() {
            return Err(ArmError::MimicInChain { joint: joint.name.clone() });
        }
        if joint.kind != JointKind::Fixed {
            active.push(index);
        }
        link = joint.parent;
    }
    active.reverse();
    if active.is_empty() {
        return Err(ArmError::NoJoints { base: base_name, tip: tip_name });
    }
    if active.len() > MAX_DOF {
        let joints = active.iter().map(|&j| model.joints[j].name.clone()).collect();
        return Err(ArmError::TooManyJoints { joints });
    }
    Ok(active)
}

/// Where a joint is held unless told otherwise.
fn rest(joint: &Joint) -> f64 {
    let (mut lower, mut upper) =
        joint.limits.map_or((f64::NEG_INFINITY, f64::INFINITY), |l| (l.lower, l.upper));
    if let Some((soft_lower, soft_upper)) = joint.safety.and_then(|s| s.soft) {
        (lower, upper) = (lower.max(soft_lower), upper.min(soft_upper));
    }
    pr2::aside(&joint.name).unwrap_or(0.0).min(upper).max(lower)
}

/// Which value each joint of the robot has.
struct Values<'a> {
    model: &'a Model,
    active: &'a [usize],
    held: &'a [HeldJoint],
}

/// The value of a joint: factor · q[source] + offset, or a constant.
enum Value {
    Constant(f64),
    Follows { source: usize, factor: f64, offset: f64 },
}

impl Values<'_> {
    fn of(&self, mut index: usize) -> Value {
        let (mut factor, mut offset) = (1.0, 0.0);
        while let Some(mimic) = self.model.joints[index].mimic {
            offset += factor * mimic.offset;
            factor *= mimic.multiplier;
            index = mimic.joint;
        }
        if let Some(source) = self.active.iter().position(|&a| a == index) {
            return Value::Follows { source, factor, offset };
        }
        let name = &self.model.joints[index].name;
        let position = self.held.iter().find(|h| h.name == *name).map_or(0.0, |h| h.position);
        Value::Constant(factor * position + offset)
    }
}

fn motion_of(axis: &nalgebra::Vector3<f64>, prismatic: bool, value: f64) -> Isometry3<f64> {
    if prismatic {
        Isometry3::from_parts((axis * value).into(), nalgebra::UnitQuaternion::identity())
    } else {
        Isometry3::from_parts(nalgebra::Translation3::identity(), about(axis, value))
    }
}

fn build_chain(values: &Values<'_>, tip: usize) -> Chain {
    let model = values.model;
    let mut joints = Vec::new();
    let mut link = tip;
    while let Some(index) = model.links[link].parent_joint {
        joints.push(index);
        link = model.joints[index].parent;
    }
    let mut steps = Vec::new();
    let mut fixed = Isometry3::identity();
    for &index in joints.iter().rev() {
        let joint = &model.joints[index];
        fixed *= joint.origin;
        let prismatic = joint.kind == JointKind::Prismatic;
        match values.of(index) {
            _ if joint.kind == JointKind::Fixed => {}
            Value::Constant(value) => {
                fixed *= motion_of(&joint.axis, prismatic, value);
            }
            Value::Follows { .. } => {
                steps.push(Step::new(fixed, *joint.axis, prismatic));
                fixed = Isometry3::identity();
            }
        }
    }
    Chain { steps, tip: fixed }
}

fn build_placements(values: &Values<'_>) -> (Vec<Placement>, Vec<usize>) {
    let model = values.model;
    let mut moving = Vec::new();
    let mut root_poses = vec![Isometry3::identity(); model.links.len()];
    let root = model.root;
    let mut placements = vec![Placement {
        link: root,
        parent: root,
        local: Isometry3::identity(),
        motion: Motion::Static,
    }];
    for &index in &model.order {
        let joint = &model.joints[index];
        let (link, parent) = (joint.child, joint.parent);
        let prismatic = joint.kind == JointKind::Prismatic;
        let carried = moving.contains(&parent);
        let mut local = joint.origin;
        let mut motion = if carried { Motion::Carried } else { Motion::Static };
        if joint.kind != JointKind::Fixed {
            match values.of(index) {
                Value::Constant(value) => local *= motion_of(&joint.axis, prismatic, value),
                Value::Follows { source, factor, offset } => {
                    motion = Motion::Joint { axis: *joint.axis, prismatic, source, factor, offset };
                }
            }
        }
        match motion {
            Motion::Static => {
                local = root_poses[parent] * local;
                root_poses[link] = local;
            }
            Motion::Carried | Motion::Joint { .. } => moving.push(link),
        }
        placements.push(Placement { link, parent, local, motion });
    }
    (placements, moving)
}
