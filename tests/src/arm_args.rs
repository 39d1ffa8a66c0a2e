//! Which robot and which of its arms: the options that the rehearsal's programs share.

use std::path::PathBuf;

use anyhow::{Context, bail};
use nullsweep_ipc_types::service;
use nullsweep_robot::{Arm, ArmSpec, JointVector, Robot};

/// Options that name the robot, its arm and where its services are.
#[derive(Clone, Debug, clap::Args)]
pub struct ArmArgs {
    /// Name of the robot in the services' names
    #[arg(long, default_value = service::DEFAULT_ROBOT)]
    pub robot_name: String,
    /// Root path of iceoryx2, to keep one system apart from another
    #[arg(long, value_name = "FOLDER")]
    pub ipc_root: Option<PathBuf>,
    /// The robot's description; without it, the PR2
    #[arg(long, value_name = "FILE")]
    pub urdf: Option<PathBuf>,
    /// The arm: right or left of the PR2, else its base and tip link, BASE,TIP
    #[arg(long, default_value = "right", value_name = "ARM")]
    pub arm: ArmSpec,
    /// Height of the PR2's torso, short for --held torso_lift_joint=H, in m
    #[arg(long, value_name = "H")]
    pub torso: Option<f64>,
    /// Where a joint outside the arm stands; may be given several times
    #[arg(long, value_name = "NAME=VALUE", value_parser = held)]
    pub held: Vec<(String, f64)>,
}

impl ArmArgs {
    /// The robot.
    pub fn robot(&self) -> anyhow::Result<Robot> {
        match &self.urdf {
            Some(path) => Robot::from_urdf_file(path)
                .with_context(|| format!("cannot use {} as a robot", path.display())),
            None => Ok(Robot::pr2()),
        }
    }

    /// The arm with its held joints in place.
    pub fn load(&self) -> anyhow::Result<Arm> {
        let robot = self.robot()?;
        let mut held: Vec<(&str, f64)> = Vec::new();
        held.extend(self.held.iter().map(|(name, position)| (name.as_str(), *position)));
        held.extend(self.torso.map(|height| ("torso_lift_joint", height)));
        Ok(robot.arm(&self.arm)?.with_held(&held)?)
    }
}

/// The posture given on the command line, or the arm's home.
pub fn initial_posture(arm: &Arm, values: &[f64]) -> anyhow::Result<JointVector> {
    if values.is_empty() {
        return Ok(arm.home());
    }
    if values.len() != arm.dof() {
        let names = arm.joint_names().join(", ");
        bail!("--initial has {} values, the arm has {} joints: {names}", values.len(), arm.dof());
    }
    let mut q = JointVector::default();
    q[..values.len()].copy_from_slice(values);
    for j in 0..arm.dof() {
        let (lower, upper) = arm.braking_limits(j, 0.0);
        if !(lower..=upper).contains(&q[j]) {
            bail!(
                "--initial: {} = {} lies outside its soft limits {lower:.4} … {upper:.4}",
                arm.joint_names()[j],
                q[j]
            );
        }
    }
    Ok(q)
}

fn held(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write JOINT=POSITION")?;
    let value: f64 = value.parse().map_err(|_| format!("`{value}` is not a number"))?;
    if value.is_finite() { Ok((name.into(), value)) } else { Err("not finite".into()) }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        arm: ArmArgs,
    }

    fn load(args: &[&str]) -> anyhow::Result<Arm> {
        Cli::try_parse_from([&["x"], args].concat())?.arm.load()
    }

    #[test]
    fn arms_are_chosen() {
        let arm = load(&["--arm", "left", "--torso", "0.2"]).expect("the PR2 has a left arm");
        assert!(arm.joint_names()[0].starts_with("l_"));
        let torso = arm.held_joints().iter().find(|h| h.name == "torso_lift_joint");
        assert!((torso.expect("held").position - 0.2).abs() < 1e-12);

        let same = load(&["--arm", "torso_lift_link:l_gripper_tool_frame"]).expect("as links");
        assert_eq!(same.fingerprint(), arm.fingerprint());
    }

    #[test]
    fn nonsense_is_refused() {
        for args in [
            ["--arm", "middle"],
            ["--held", "torso_lift_joint"],
            ["--held", "torso_lift_joint=NaN"],
            ["--held", "no_such_joint=1"],
            ["--urdf", "no/such/file.urdf"],
        ] {
            assert!(load(&args).is_err(), "{args:?}");
        }
        let arm = load(&[]).expect("the PR2's right arm");
        assert!(initial_posture(&arm, &[0.0; 6]).is_err());
        assert!(initial_posture(&arm, &[9.0; 7]).is_err());
        assert_eq!(initial_posture(&arm, &[]).expect("home"), arm.home());
    }
}
