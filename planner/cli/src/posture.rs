//! What a posture that is asked for is: by its name, its joints, or as it is measured.

use std::time::Duration;

use nullsweep_collision::{self as collision, CollisionError};
use nullsweep_planner::link::Site;
use nullsweep_planner::link::posture::posture;
use nullsweep_planner::progress::Progress;
use nullsweep_robot::{Arm, JointVector};

use crate::bars::Bars;
use crate::exit::Usage;
use crate::posture_arg::PostureArg;
use crate::robot::RobotArgs;

/// How long the executor's word is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

impl PostureArg {
    /// The joint vector that is meant.
    ///
    /// # Errors
    /// Wrong usage for a name that nobody knows, or too many or too few joints. For the measured
    /// posture also whatever keeps the executor from telling it.
    pub(super) fn resolve(
        &self,
        arm: &Arm,
        robot: &RobotArgs,
        site: Site<'_>,
        bars: &Bars,
    ) -> anyhow::Result<JointVector> {
        match self {
            Self::Measured => {
                let measured = posture(site, arm, PATIENCE)?;
                measured.notes.iter().for_each(|note| bars.note(note));
                Ok(measured.q)
            }
            Self::Joints(joints) => vector(arm, joints),
            Self::Named(name) => {
                let name = name.to_lowercase();
                let postures = known(robot)?;
                if let Some((_, joints)) = postures.iter().find(|(known, _)| *known == name) {
                    return joints.vector(arm);
                }
                if name == "home" {
                    bars.note("home is taken to be the middle of the joints' ranges");
                    return Ok(arm.home());
                }
                let names: Vec<&str> = postures.iter().map(|(name, _)| name.as_str()).collect();
                let known = if names.is_empty() { "home".into() } else { names.join(", ") };
                Err(Usage(format!(
                    "there is no posture `{name}`, only {known}: --posture {name}=Q1,Q2,… says what \
                     it is, as do `postures` in a cell file and group_state in an SRDF"
                ))
                .into())
            }
        }
    }
}

/// Joints of a posture, in order or by their names.
enum Joints {
    InOrder(Vec<f64>),
    ByName(Vec<(String, f64)>),
}

impl Joints {
    fn vector(&self, arm: &Arm) -> anyhow::Result<JointVector> {
        match self {
            Self::InOrder(joints) => vector(arm, joints),
            Self::ByName(joints) => {
                let of = |name: &String| joints.iter().find(|(joint, _)| joint == name);
                let all = arm.joint_names().iter().map(|name| of(name).map(|(_, value)| *value));
                match all.collect::<Option<Vec<f64>>>() {
                    Some(all) => vector(arm, &all),
                    None => {
                        Err(Usage("the SRDF's posture leaves out a joint of the arm".into()).into())
                    }
                }
            }
        }
    }
}

/// Whether a word is a posture that somebody has named.
pub(super) fn is_known(robot: &RobotArgs, word: &str) -> anyhow::Result<bool> {
    let word = word.to_lowercase();
    Ok(["home", "measured"].contains(&&word[..]) || known(robot)?.iter().any(|(n, _)| *n == word))
}

/// Every posture with a name, in lower case: those given first, then the SRDF's.
fn known(robot: &RobotArgs) -> anyhow::Result<Vec<(String, Joints)>> {
    let given = robot
        .postures()
        .iter()
        .map(|p| (p.name().to_owned(), Joints::InOrder(p.joints().to_vec())));
    let mut all: Vec<(String, Joints)> = given.collect();
    if let Some(path) = &robot.collision().srdf {
        let states = collision::group_states(path).map_err(CollisionError::from)?;
        all.extend(states.into_iter().map(|s| (s.name.to_lowercase(), Joints::ByName(s.joints))));
    }
    Ok(all)
}

/// As many numbers as the arm has joints.
fn vector(arm: &Arm, joints: &[f64]) -> anyhow::Result<JointVector> {
    if joints.len() != arm.dof() {
        let names = arm.joint_names().join(", ");
        let (given, wanted) = (joints.len(), arm.dof());
        return Err(Usage(format!(
            "a posture of {given} joints, but the arm has {wanted}: {names}"
        ))
        .into());
    }
    let mut q = JointVector::ZERO;
    q[..joints.len()].copy_from_slice(joints);
    Ok(q)
}
