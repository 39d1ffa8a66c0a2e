//! Closed-form inverse kinematics of arms with six free joints that fall apart into subproblems:
//! Universal Robots' arms, most industrial ones, and, with one joint held, arms with a spherical
//! shoulder or wrist (KUKA's iiwa, Franka's Panda). [`super::six`] knows the kinds.
//!
//! Arms are recognised by their axes, in either direction, also where a calibration has moved
//! these a little: what the closed form finds is put on the true arm by Newton steps, and nothing
//! is given out that forward kinematics do not confirm.
//!
//! Singular: where both angles of a subproblem are one, two branches meet and end; where two axes
//! come to lie in one line (the wrist straight, the wrist centre on the first axis), one of both
//! angles keeps its value.

use nalgebra::Isometry3;

use super::damped::{damped_step_over, pose_error};
use super::folds::same;
use super::redundancy::Redundancy;
use super::six::{Kind, Question, Shape};
use super::solution::{Branch, InverseKinematics, Solution, Solutions};
use super::subproblem::Slack;
use crate::chain::{Chain, JointAxis};
use crate::joints::{unwrap_near, wrap};
use crate::limits::JointLimits;
use crate::{JointVector, MAX_DOF};

/// The solver. Branch: bit 5 is its mark, bits 0 to 2 say which of two angles each of three
/// joints takes.
#[derive(Debug)]
pub(crate) struct Analytic {
    chain: Chain,
    limits: Vec<JointLimits>,
    margined: Vec<(f64, f64)>,
    redundancy: Redundancy,
    kind: Kind,
    /// The free joints in the order in which `kind` takes them, and whether that is from tip to
    /// base.
    joints: [usize; 6],
    backwards: bool,
    /// How far the arm is from `kind`, see [`Shape`].
    deviation: f64,
}

const MARK: u8 = 1 << 5;
/// Deviation up to which the closed form is the arm's own. [m, or sine]
const EXACT: f64 = 1e-9;
/// Deviation of an arm that a calibration has moved. [m, or sine]
const CALIBRATED: f64 = 0.01;
/// Slack of a subproblem for each metre or unit of deviation (angles of the true arm turn about
/// lengths of a tenth of a metre), and the most of it.
const SLACKS: &[f64] = &[0.0, 10.0, 30.0];
const MOST_SLACK: f64 = 0.1;
/// Largest error of a solution, in metres and radians alike.
const RESIDUAL: f64 = 1e-10;
/// Two solutions nearer than this are one. \[rad\]
const SAME: f64 = 1e-7;
/// Most Newton steps to there, and how far they may lead. \[rad\]
const STEPS: usize = 24;
const DAMPING: f64 = 1e-4;
const NEAR: f64 = 0.5;
/// Order in which joints of seven are tried as the redundancy: the upper-arm roll of most arms
/// first, then the last joint.
const HELD: [usize; 7] = [2, 6, 4, 0, 1, 5, 3];

impl Analytic {
    /// The solver of a chain that has a closed form with six joints free.
    pub(crate) fn recognise(
        chain: &Chain,
        limits: &[JointLimits],
        margined: &[(f64, f64)],
    ) -> Option<Self> {
        let held: Vec<Option<usize>> = match chain.dof() {
            6 => vec![None],
            7 => HELD.into_iter().map(Some).collect(),
            _ => return None,
        };
        let fits = |most: f64| {
            held.iter().find_map(|&held| {
                let free: Vec<usize> = (0..chain.dof()).filter(|i| Some(*i) != held).collect();
                if free.iter().any(|&i| chain.steps[i].prismatic) {
                    return None;
                }
                let mut joints: [usize; 6] = free.try_into().ok()?;
                for backwards in [false, true] {
                    if let Some(shape) = shape(chain, held, &joints, backwards, most) {
                        return Some((held, joints, backwards, shape));
                    }
                    joints.reverse();
                }
                None
            })
        };
        let (redundant, joints, backwards, Shape { kind, deviation }) =
            fits(EXACT).or_else(|| fits(CALIBRATED))?;
        Some(Self {
            chain: chain.clone(),
            limits: limits.to_vec(),
            margined: margined.to_vec(),
            redundancy: Redundancy::new(redundant, margined, |joint| limits[joint].continuous),
            kind,
            joints,
            backwards,
            deviation,
        })
    }

    /// Calls `found` with the joint vectors of the closed form, on one branch or on all.
    fn postures(
        &self,
        target: &Isometry3<f64>,
        redundancy: f64,
        branch: Option<u8>,
        near: &JointVector,
        reach: f64,
        mut found: impl FnMut(u8, JointVector),
    ) {
        let mut zero = JointVector::ZERO;
        self.redundancy.hold(&mut zero, redundancy);
        let (tip, axes) = self.chain.axes(&zero);
        let motion = target * tip.inverse();
        let question = Question {
            axes: &ordered(&axes, &self.joints, self.backwards),
            motion: if self.backwards { motion.inverse() } else { motion },
            branch,
            free: self.joints.map(|j| near[j]),
            slack: self.slack(reach * self.deviation),
            // A direction that is off by an angle is off by its square along another one.
            direction_slack: self.slack((reach * self.deviation).powi(2)),
        };
        self.kind.angles(&question, |bits, angles| {
            let mut q = zero;
            for (joint, angle) in self.joints.iter().zip(angles) {
                q[*joint] = angle;
            }
            found(bits, q);
        });
    }

    fn is_exact(&self) -> bool {
        self.deviation <= EXACT
    }

    /// How much slack the closed form is tried with, one after the other, see [`SLACKS`].
    fn reaches(&self) -> &'static [f64] {
        if self.is_exact() { &SLACKS[..1] } else { SLACKS }
    }

    fn slack(&self, share: f64) -> Slack {
        match self.is_exact() {
            true => Slack { past: EXACT, short: 0.0 },
            false => Slack::calibrated(share.min(MOST_SLACK)),
        }
    }

    /// Newton steps onto the true arm; `None` where they do not arrive nearby.
    fn settle(&self, target: &Isometry3<f64>, seed: &JointVector) -> Option<JointVector> {
        if pose_error(&self.chain.tip_pose(seed), target).amax() < RESIDUAL {
            return Some(*seed);
        }
        let mut free = [false; MAX_DOF];
        self.joints.iter().for_each(|&j| free[j] = true);
        let mut q = *seed;
        for _ in 0..STEPS {
            let (tip, jacobian) = self.chain.jacobian(&q);
            let error = pose_error(&tip, target);
            if error.amax() < RESIDUAL {
                return Some(q);
            }
            // Damped by the error itself: still quadratic, and steady near a singularity.
            let damping = (DAMPING * error.norm_squared()).max(1e-16);
            let step = damped_step_over(&jacobian, &free, &error, damping);
            for (value, step) in q.iter_mut().zip(&step) {
                *value += step;
            }
            if q.iter().zip(seed).any(|(a, b)| (a - b).abs() > NEAR) {
                return None;
            }
        }
        (pose_error(&self.chain.tip_pose(&q), target).amax() < RESIDUAL).then_some(q)
    }

    /// Joint values as the trait promises them.
    fn represent(&self, q: &mut JointVector) {
        for &joint in &self.joints {
            let JointLimits { lower, upper, continuous, .. } = self.limits[joint];
            q[joint] = match continuous {
                true => wrap(q[joint]),
                false => unwrap_near(q[joint], 0.5 * (lower + upper)),
            };
        }
    }

    fn within(&self, q: &JointVector, slack: f64) -> bool {
        let inside =
            |(q, (low, high)): (&f64, &(f64, f64))| low - slack <= *q && *q <= high + slack;
        q.iter().zip(&self.margined).all(inside)
    }
}

impl InverseKinematics for Analytic {
    fn redundancy_range(&self) -> Option<(f64, f64)> {
        self.redundancy.range
    }

    fn redundant_joint(&self) -> Option<usize> {
        self.redundancy.joint
    }

    fn solve(&self, target: &Isometry3<f64>, redundancy: f64, out: &mut Solutions) {
        out.clear();
        // What is far outside of the limits is not worth a look.
        let reserve = if self.is_exact() { EXACT } else { NEAR };
        let mut settled = 0u8;
        for &reach in self.reaches() {
            let near = JointVector::ZERO;
            self.postures(target, redundancy, None, &near, reach, |bits, mut q| {
                if settled & 1 << bits != 0 {
                    return;
                }
                self.represent(&mut q);
                if !self.within(&q, reserve) {
                    settled |= 1 << bits;
                    return;
                }
                let Some(mut q) = self.settle(target, &q) else { return };
                settled |= 1 << bits;
                self.represent(&mut q);
                let redundancy = self.redundancy.of(&q);
                if self.within(&q, 0.0) && !out.iter().any(|s| same(&s.q, &q, SAME)) {
                    let branch = Branch(MARK | bits);
                    // Eight at most, which is less than the capacity.
                    let _ = out.push(Solution { q, branch, redundancy });
                }
            });
            if settled == u8::MAX {
                return;
            }
        }
    }

    fn solve_on(
        &self,
        branch: Branch,
        target: &Isometry3<f64>,
        redundancy: f64,
        near: &JointVector,
    ) -> Option<Solution> {
        if branch.0 & !7 != MARK {
            return None;
        }
        let mut q = self.reaches().iter().find_map(|&reach| {
            let mut posture = None;
            let bits = Some(branch.0 & 7);
            self.postures(target, redundancy, bits, near, reach, |_, q| posture = Some(q));
            self.settle(target, &posture?)
        })?;
        for &joint in &self.joints {
            q[joint] = unwrap_near(q[joint], near[joint]);
        }
        let redundancy = self.redundancy.of(&q);
        Some(Solution { q, branch, redundancy })
    }
}

/// The axes as a kind takes them: reversed rotations come in the other order.
fn ordered(axes: &[JointAxis; MAX_DOF], joints: &[usize; 6], backwards: bool) -> [JointAxis; 6] {
    joints.map(|j| {
        let JointAxis { direction, point } = axes[j];
        JointAxis { direction: if backwards { -direction } else { direction }, point }
    })
}

/// The shape of the free joints wherever the held one is.
fn shape(
    chain: &Chain,
    held: Option<usize>,
    joints: &[usize; 6],
    backwards: bool,
    most: f64,
) -> Option<Shape> {
    let shape = |value: f64| {
        let mut q = JointVector::ZERO;
        if let Some(held) = held {
            q[held] = value;
        }
        let axes = chain.axes(&q).1;
        Shape::of(&ordered(&axes, joints, backwards)).filter(|shape| shape.deviation <= most)
    };
    let (one, other) = (shape(0.4)?, shape(-1.1)?);
    (one.kind == other.kind)
        .then_some(Shape { deviation: one.deviation.max(other.deviation), ..one })
}
