//! The flags that say which robot it is and what its links look like.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::Context;
use clap::Args;
use nullsweep_collision::{MeshPaths, Options};
use nullsweep_planner::plan::Plan;
use nullsweep_planner::progress::Progress;
use nullsweep_robot::{Arm, ArmSpec, Robot, Side, Tool};

use crate::bars::Bars;
use crate::posture_arg::NamedPosture;

#[derive(Clone, Debug, Args)]
pub(super) struct RobotArgs {
    /// The robot's URDF; without it the PR2.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// The arm: `right` or `left` of the PR2, else its base and tip link, BASE,TIP.
    #[arg(long, value_name = "ARM", default_value = "right", alias = "chain")]
    arm: ArmSpec,
    /// Folder of a ROS package that meshes are in: package://NAME/… is FOLDER/…; may be repeated.
    #[arg(long, value_name = "NAME=FOLDER")]
    package: Vec<Package>,
    /// Put capsules of this radius along links whose collision mesh is missing. [m]
    #[arg(long, value_name = "RADIUS", value_parser = radius)]
    fit_capsules: Option<f64>,
    /// Take the pairs of links that may touch from this SRDF instead of finding them.
    #[arg(long, value_name = "FILE")]
    srdf: Option<PathBuf>,
    /// A posture with a name, its joints from base to tip; may be repeated.
    #[arg(long, value_name = "NAME=Q1,Q2,…")]
    posture: Vec<NamedPosture>,
}

#[derive(Clone, Debug)]
struct Package(String, PathBuf);

impl FromStr for Package {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, folder) = text.split_once('=').ok_or("NAME=FOLDER is wanted")?;
        if Path::new(folder).is_dir() {
            Ok(Self(name.into(), folder.into()))
        } else {
            Err(format!("{folder} is not a folder"))
        }
    }
}

fn radius(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|e| format!("{e}"))?;
    if value > 0.0 && value < 1.0 { Ok(value) } else { Err("0 to 1 m is wanted".into()) }
}

/// What a robot and its shapes are read from.
pub(super) struct Files<'a> {
    pub(super) urdf: Option<&'a Path>,
    pub(super) srdf: Option<&'a Path>,
    pub(super) fit_capsules: Option<f64>,
    pub(super) packages: Vec<(&'a str, &'a Path)>,
}

impl RobotArgs {
    pub(super) fn robot(&self) -> anyhow::Result<Robot> {
        Ok(match &self.urdf {
            Some(path) => Robot::from_urdf_file(path)?,
            None => Robot::pr2(),
        })
    }

    /// The same with another of the robot's arms.
    pub(super) fn with_arm(&self, arm: ArmSpec) -> Self {
        Self { arm, ..self.clone() }
    }

    pub(super) fn spec(&self) -> ArmSpec {
        self.arm.clone()
    }

    /// The arm, its held joints where the robot has them.
    pub(super) fn arm(&self) -> anyhow::Result<Arm> {
        Ok(self.robot()?.arm(&self.arm)?)
    }

    /// Whether it is the PR2 as this project describes it.
    pub(super) fn is_pr2(&self) -> bool {
        self.urdf.is_none()
    }

    /// Whether nothing was said of the arm.
    pub(super) fn is_default_arm(&self) -> bool {
        self.arm == ArmSpec::pr2(Side::Right)
    }

    /// What it is read from.
    pub(super) fn files(&self) -> Files<'_> {
        Files {
            urdf: self.urdf.as_deref(),
            srdf: self.srdf.as_deref(),
            fit_capsules: self.fit_capsules,
            packages: self.package.iter().map(|p| (p.0.as_str(), p.1.as_path())).collect(),
        }
    }

    pub(super) fn postures(&self) -> &[NamedPosture] {
        &self.posture
    }

    /// What is taken of the arm that its description does not say.
    pub(super) fn tell(&self, robot: &Robot, bars: &Bars) -> anyhow::Result<()> {
        let arm = robot.arm(&self.spec())?;
        let hard = arm.joints_without_soft_limits();
        if !hard.is_empty() {
            bars.note(&format!(
                "no soft limits: {} keep 0.01 rad or m from their hard ones",
                hard.join(", ")
            ));
        }
        for posture in &self.posture {
            let found = posture.joints().len();
            if found != arm.dof() {
                let (name, dof) = (posture.name(), arm.dof());
                bars.note(&format!(
                    "posture {name} has {found} joints, this arm has {dof}: it is none of it"
                ));
            }
        }
        Ok(())
    }

    /// How its collision shapes are found.
    pub(super) fn collision(&self) -> Options {
        let folder = self.urdf.as_deref().and_then(Path::parent);
        Options {
            meshes: MeshPaths::of_machine(
                folder.unwrap_or(Path::new("")),
                self.package.iter().map(|p| (p.0.clone(), p.1.clone())).collect(),
            ),
            fit_capsules: self.fit_capsules,
            srdf: self.srdf.clone(),
            ..Options::default()
        }
    }
}

/// Reads a tool's file.
pub(super) fn tool_file(path: &Path) -> anyhow::Result<Tool> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    toml::from_str(&text).with_context(|| format!("{}: not a tool", path.display()))
}

/// In what an arm is another one than a plan was made for.
pub(super) fn differs(plan: &Plan, arm: &Arm) -> String {
    let robot = arm.robot();
    let given = robot.name();
    if plan.joints == arm.joint_names() {
        return format!(
            "the plan was made for another {} than {given} is here: the joints have the same names, but \
             their limits, axes or places are others, as after a change of the URDF",
            plan.robot
        );
    }
    format!(
        "the plan moves {} of {}, the arm given is {} of {given}",
        plan.joints.join(", "),
        plan.robot,
        arm.joint_names().join(", ")
    )
}
