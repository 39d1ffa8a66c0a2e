//! The flags that say which robot it is and what its links look like.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::Context;
use clap::Args;
use nullsweep_collision::{MeshPaths, Options};
use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

#[derive(Debug, Args)]
pub(super) struct RobotArgs {
    /// The robot's URDF; without it the PR2.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Which arm of the PR2.
    #[arg(long, value_enum, default_value = "right")]
    arm: ArmSide,
    /// Base and tip link of another robot's arm: BASE,TIP.
    #[arg(long, value_name = "BASE,TIP", requires = "urdf")]
    chain: Option<String>,
    /// Folder of a ROS package that meshes are in: package://NAME/… is FOLDER/…; may be repeated.
    #[arg(long, value_name = "NAME=FOLDER")]
    package: Vec<Package>,
    /// Put capsules of this radius along links whose collision mesh is missing. [m]
    #[arg(long, value_name = "RADIUS", value_parser = radius)]
    fit_capsules: Option<f64>,
    /// Take the pairs of links that may touch from this SRDF instead of finding them.
    #[arg(long, value_name = "FILE")]
    srdf: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum ArmSide {
    Left,
    Right,
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

impl RobotArgs {
    pub(super) fn robot(&self) -> anyhow::Result<Robot> {
        Ok(match &self.urdf {
            Some(path) => Robot::from_urdf_file(path)?,
            None => Robot::pr2(),
        })
    }

    pub(super) fn spec(&self) -> anyhow::Result<ArmSpec> {
        if let Some(chain) = &self.chain {
            let (base, tip) = chain.split_once(',').context("--chain: BASE,TIP is wanted")?;
            return Ok(ArmSpec { base: base.into(), tip: tip.into() });
        }
        Ok(ArmSpec::pr2(match self.arm {
            ArmSide::Left => Side::Left,
            ArmSide::Right => Side::Right,
        }))
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
