//! What stops are looked for.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::{Arm, ArmError, ArmSpec, JointVector, MAX_DOF, Robot};

use crate::pipeline::Job;
use crate::workcell::{Stance, StanceSearch};

/// What stops are looked for.
#[derive(Clone, Debug)]
pub struct Setup {
    /// How each of their plans is made: its arm, stance, start, end and what is spared are set for each.
    pub job: Job,
    /// The arms that work, one after the other at a stop.
    pub arms: Vec<ArmSpec>,
    /// Whether the two of them work at once instead, where they can.
    pub together: bool,
    /// How many stops there are at most; `None`: as many as are worth it.
    pub most: Option<usize>,
    /// Held joints that are given. \[rad\] or \[m\]
    pub held: Vec<(String, f64)>,
    /// The joint that lifts the arms, and the positions that it may have at a stop. \[m\]
    pub lift: Option<(String, Vec<f64>)>,
    /// The posture in which an arm begins and ends at a stop, and rests while the other works; `None`:
    /// where the robot's description holds it while another arm works, or the arm's home.
    pub tucked: Option<JointVector>,
    /// How high above the floor the robot's root frame is. \[m\]
    pub height: f64,
}

/// The lift of a robot, where it is known, and the positions of it that are tried. \[m\]
#[must_use]
pub fn lifts(robot: &Robot, arm: &Arm, job: &Job) -> Option<(String, Vec<f64>)> {
    StanceSearch::of(robot, arm, &job.tool).lift
}

/// An arm of a setup with its held joints where they are by default.
pub(super) struct Limb {
    pub(super) spec: ArmSpec,
    pub(super) arm: Arm,
    /// Where it begins and ends.
    pub(super) tucked: JointVector,
    /// How far the pad's centre comes from the arm's first axis. \[m\]
    pub(super) reach: f64,
}

/// Configurations by which an arm's reach is measured.
const REACH_SAMPLES: usize = 2000;
/// Space around what the arms reach that is looked at beside it: a hand, an elbow. \[m\]
const AROUND: f64 = 0.5;

impl Setup {
    /// The arms, each in a robot whose other arms are tucked.
    pub(super) fn limbs(&self, robot: &Robot) -> Result<Vec<Limb>, ArmError> {
        let arms: Vec<Arm> =
            self.arms.iter().map(|spec| robot.arm(spec)).collect::<Result<_, _>>()?;
        let limb = |(a, spec): (usize, &ArmSpec)| {
            let arm = &arms[a];
            let tucked = self.tucked.unwrap_or_else(|| beside(arm, &arms));
            let pivot = self.pivot(robot, arm);
            let pad = self.job.tool.on(arm);
            let reach = (0..REACH_SAMPLES)
                .map(|k| (pad.centre(&arm.spread(k)) - pivot).norm())
                .fold(0.0, f64::max);
            Limb { spec: spec.clone(), arm: arm.clone(), tucked, reach }
        };
        Ok(self.arms.iter().enumerate().map(limb).collect())
    }

    /// Where an arm's first axis is, its held joints as they are. \[m\]
    pub(super) fn pivot(&self, robot: &Robot, arm: &Arm) -> Point3<f64> {
        let mut poses = vec![Isometry3::identity(); robot.links().len()];
        arm.link_poses(&JointVector::ZERO, &mut poses);
        Point3::from(poses[arm.moving_links()[0]].translation.vector)
    }

    /// How far from the root frame's axis there is anything that a stop has to do with. \[m\]
    pub(super) fn around(&self, robot: &Robot, limbs: &[Limb]) -> f64 {
        let far = |limb: &Limb| {
            let pivot = self.pivot(robot, &limb.arm);
            libm::hypot(pivot.x, pivot.y) + limb.reach + AROUND
        };
        limbs.iter().map(far).fold(0.0, f64::max)
    }

    /// A stance with the held joints that are given, and the lift where it is chosen.
    pub(super) fn stance(&self, base: [f64; 3], lift: Option<f64>) -> Stance {
        let chosen = self.lift.as_ref().zip(lift).map(|((name, _), at)| (name.clone(), at));
        Stance {
            base,
            height: self.height,
            held: self.held.iter().cloned().chain(chosen).collect(),
        }
    }

    /// The positions of the lift that are tried; one `None` where there is none.
    pub(super) fn heights(&self) -> Vec<Option<f64>> {
        match &self.lift {
            Some((_, values)) => values.iter().copied().map(Some).collect(),
            None => vec![None],
        }
    }
}

/// Where another arm's description of the robot holds this arm's joints, so that it is in the same place
/// whoever works; the arm's home where it works alone.
fn beside(arm: &Arm, arms: &[Arm]) -> JointVector {
    let held = |name: &String| {
        let others = arms.iter().flat_map(|other| other.held_joints());
        others.filter(|held| held.name == *name).map(|held| held.position).next()
    };
    let mut tucked = [0.0; MAX_DOF];
    for (value, name) in tucked.iter_mut().zip(arm.joint_names()) {
        match held(name) {
            Some(position) => *value = position,
            None => return arm.home(),
        }
    }
    JointVector::new(tucked)
}
