//! Jerk limits, by the name of a robot or from a file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, ensure};
use nullsweep_planner::timing;
use nullsweep_robot::{Arm, JointVector};
use serde::Deserialize;

/// Where each joint's jerk limit comes from.
#[derive(Clone, Debug)]
pub(super) enum JerkArg {
    /// What is known of the PR2 and of UR's arms: nothing is published, so each joint is taken to
    /// come to its full acceleration in 0.1 s.
    Assumed,
    /// libfranka's kMaxJointJerk for the Panda.
    Franka,
    /// A TOML file: a table `jerk` of joint names. \[rad/s³\] or \[m/s³\]
    File(PathBuf),
}

/// libfranka, rate_limiting.h, kMaxJointJerk: base to tip. \[rad/s³\]
const FRANKA: [f64; 7] = [7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    jerk: BTreeMap<String, f64>,
}

impl FromStr for JerkArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "pr2" | "ur" => Self::Assumed,
            "franka" => Self::Franka,
            file if Path::new(file).is_file() => Self::File(file.into()),
            _ => return Err("pr2, ur, franka or a TOML file is wanted".into()),
        })
    }
}

impl JerkArg {
    /// Each joint's, never above what the URDF has.
    pub(super) fn of(&self, arm: &Arm) -> anyhow::Result<JointVector> {
        let mut jerk = timing::jerks(arm);
        match self {
            Self::Assumed => {}
            Self::Franka => {
                ensure!(arm.dof() == 7, "--jerk franka: the arm has {} joints, not 7", arm.dof());
                jerk[..7].copy_from_slice(&FRANKA);
            }
            Self::File(path) => {
                let text = std::fs::read_to_string(path)
                    .with_context(|| format!("cannot read {}", path.display()))?;
                let File { jerk: table } = toml::from_str(&text)
                    .with_context(|| format!("{}: no jerk limits", path.display()))?;
                for (j, name) in arm.joint_names().iter().enumerate() {
                    let value = table.get(name).with_context(|| {
                        format!("{}: no jerk limit of {name} in [rad/s³]", path.display())
                    })?;
                    ensure!(
                        value.is_finite() && *value > 0.0,
                        "{}: {name} = {value}: a jerk above 0 rad/s³ is wanted",
                        path.display()
                    );
                    jerk[j] = *value;
                }
            }
        }
        for (jerk, joint) in jerk.iter_mut().zip(arm.limits()) {
            *jerk = joint.jerk.map_or(*jerk, |most| most.min(*jerk));
        }
        Ok(jerk)
    }
}
