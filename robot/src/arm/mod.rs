//! An arm of a robot: a serial chain with limits, poses, Jacobian and inverse kinematics.

mod assembly;
mod error;

use std::sync::Arc;

use nalgebra::Isometry3;

use crate::chain::{Chain, Jacobian};
use crate::fingerprint::fingerprint;
use crate::ik::{InverseKinematics, Numeric, RedundantJoint, Solvers, spread_over};
use crate::limits::JointLimits;
use crate::spec::{ArmSpec, HeldJoint};
use crate::urdf::{Joint, JointKind, Model, Robot};
use crate::{Continuous, JointVector, MAX_DOF, pr2};
use assembly::{Motion, Placement, Values, build_chain, build_placements, motion_of};

pub use error::ArmError;

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

    /// Which joints turn without end.
    #[must_use]
    pub fn continuous(&self) -> Continuous {
        Continuous::of(&self.limits)
    }

    /// Whether a joint of the chain turns; else it slides.
    #[must_use]
    pub fn is_revolute(&self, joint: usize) -> bool {
        !self.chain.steps[joint].prismatic
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
        let index = |name: &String| self.model.joints.iter().position(|j| j.name == *name);
        let active: Vec<usize> = self.names.iter().filter_map(index).collect();
        let (model, spec) = (self.model.clone(), self.spec.clone());
        Ok(Self::assemble(model, spec, &active, self.limits.clone(), held))
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

    /// Pose of the tip and [`Self::jacobian`], for little more than the Jacobian alone costs.
    #[must_use]
    pub fn tip_pose_and_jacobian(&self, q: &JointVector) -> (Isometry3<f64>, Jacobian) {
        self.chain.jacobian(q)
    }

    /// The soft limits of a joint moved in by |velocity| / k_position: where the arm may be at
    /// that speed. The one rule of planner and executor; see [`JointLimits::braking`].
    #[must_use]
    pub fn braking_limits(&self, joint: usize, velocity: f64) -> (f64, f64) {
        self.limits[joint].braking(velocity)
    }

    /// Joints with hard limits only: [`Arm::margined_limits`] keep 0.01 rad or m from these, and at
    /// most a hundredth of the range.
    #[must_use]
    pub fn joints_without_soft_limits(&self) -> Vec<&str> {
        let is_hard =
            |name: &&String| self.model.joints.iter().any(|j| j.name == **name && is_hard(j));
        self.names.iter().filter(is_hard).map(String::as_str).collect()
    }

    /// [`Arm::braking_limits`] of each joint at its largest speed, and a little inside of hard limits
    /// where there are no soft ones.
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
        JointVector::new(home)
    }

    /// The k-th joint vector of a fixed sequence that fills the margined ranges evenly; continuous
    /// joints take −π … π.
    #[must_use]
    pub fn spread(&self, k: usize) -> JointVector {
        spread_over(&self.margined, k)
    }

    /// Inverse kinematics. In closed form for an arm of the PR2's shape (the upper-arm roll is the
    /// redundancy), six-axis arms with a spherical wrist or three parallel axes, and arms of seven
    /// that are like that with one joint held; numeric otherwise.
    #[must_use]
    pub fn ik(&self) -> &dyn InverseKinematics {
        self.solvers.default()
    }

    /// Inverse kinematics with another joint as redundancy, where there is one.
    #[must_use]
    pub fn ik_by(&self, joint: RedundantJoint) -> Option<&dyn InverseKinematics> {
        self.solvers.by(joint)
    }

    /// The numeric solver whatever the arm's shape: a second opinion on the closed form. Making it
    /// takes some milliseconds.
    #[must_use]
    pub fn numeric_ik(&self) -> Box<dyn InverseKinematics> {
        Box::new(Numeric::new(&self.chain, &self.limits, &self.margined))
    }

    /// Whether the inverse kinematics is numeric: some hundred times slower than a closed form.
    #[must_use]
    pub fn has_numeric_ik(&self) -> bool {
        self.solvers.is_numeric()
    }

    /// Same kinematics as the PR2's and its joint names.
    fn is_pr2(&self) -> bool {
        self.solvers.is_pr2_shaped() && self.names.iter().all(|n| pr2::ready(n).is_some())
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
        let margined: Vec<_> = active
            .iter()
            .zip(&limits)
            .map(|(&joint, limits)| {
                let (lower, upper) = limits.braking(limits.velocity);
                let margin = match is_hard(&model.joints[joint]) {
                    true => HARD_MARGIN.min(HARD_SHARE * (upper - lower)),
                    false => 0.0,
                };
                (lower + margin, upper - margin)
            })
            .collect();
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

/// What is kept from hard limits where there are no soft ones [rad or m], and the most of a joint's
/// range that is so lost at either end.
const HARD_MARGIN: f64 = 0.01;
const HARD_SHARE: f64 = 0.01;

/// Whether a joint's limits are hard ones.
fn is_hard(joint: &Joint) -> bool {
    joint.kind != JointKind::Continuous && joint.safety.and_then(|s| s.soft).is_none()
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
    // A joint below the base that follows one of the arm's would move the base.
    while let Some(index) = model.links[link].parent_joint {
        let source = |mut index: usize| {
            while let Some(mimic) = model.joints[index].mimic {
                index = mimic.joint;
            }
            index
        };
        if active.contains(&source(index)) {
            return Err(ArmError::MimicInChain { joint: model.joints[index].name.clone() });
        }
        link = model.joints[index].parent;
    }
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
