//! A plan as the fields of trajectory_msgs/JointTrajectory, for other programs.

use std::io::{self, Write};

use nullsweep_robot::{JointVector, MAX_DOF};
use serde::Serialize;

use super::file::Plan;

/// How a trajectory is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// As `rostopic pub -f` reads it.
    RosYaml,
    /// As `ros2 topic pub` takes it.
    Ros2Yaml,
    /// A line a knot: time, positions, velocities, patch, whether the pad is on the surface.
    Csv,
    /// The message's fields by their names.
    Json,
}

/// trajectory_msgs/JointTrajectory.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointTrajectory {
    /// std_msgs/Header with a stamp of 0: start at once.
    pub header: Header,
    /// Base to tip.
    pub joint_names: Vec<String>,
    /// One for each knot.
    pub points: Vec<Point>,
}

/// std_msgs/Header.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Header {
    /// Set by ROS.
    pub seq: u32,
    /// When the trajectory starts.
    pub stamp: Time,
    /// Not used by trajectories.
    pub frame_id: String,
}

/// A time or duration of ROS 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Time {
    /// Whole seconds.
    pub secs: u64,
    /// The rest.
    pub nsecs: u64,
}

/// trajectory_msgs/JointTrajectoryPoint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// \[rad\] or \[m\], continuous joints unwrapped.
    pub positions: Vec<f64>,
    /// \[rad/s\] or \[m/s\]; none for bang-bang velocity: controllers then interpolate linearly.
    pub velocities: Vec<f64>,
    /// None: controllers interpolate cubically.
    pub accelerations: Vec<f64>,
    /// None.
    pub effort: Vec<f64>,
    /// Since the start.
    pub time_from_start: Time,
}

/// The plan's motion.
#[must_use]
pub fn trajectory(plan: &Plan) -> JointTrajectory {
    let lanes = |q: &JointVector| q.iter().copied().take(plan.joints.len()).collect();
    let curved = plan.profile.is_curved();
    let points = plan
        .knots
        .iter()
        .map(|k| Point {
            positions: lanes(&k.q),
            velocities: if curved { lanes(&k.v) } else { Vec::new() },
            accelerations: Vec::new(),
            effort: Vec::new(),
            time_from_start: Time {
                secs: k.time_ns / 1_000_000_000,
                nsecs: k.time_ns % 1_000_000_000,
            },
        })
        .collect();
    JointTrajectory { header: Header::default(), joint_names: plan.joints.clone(), points }
}

/// Writes the plan's motion.
///
/// # Errors
/// What the writer says.
pub fn write(plan: &Plan, format: Format, out: &mut impl Write) -> io::Result<()> {
    match format {
        Format::RosYaml => yaml(&trajectory(plan), ["seq: 0, ", "secs", "nsecs"], out),
        Format::Ros2Yaml => yaml(&trajectory(plan), ["", "sec", "nanosec"], out),
        Format::Csv => csv(plan, out),
        Format::Json => {
            serde_json::to_writer_pretty(&mut *out, &trajectory(plan))?;
            writeln!(out)
        }
    }
}

/// By what a version of ROS has in a header before its stamp, and calls the parts of a time.
fn yaml(
    trajectory: &JointTrajectory,
    [before, whole, rest]: [&str; 3],
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "header: {{{before}stamp: {{{whole}: 0, {rest}: 0}}, frame_id: ''}}")?;
    writeln!(out, "joint_names: [{}]", trajectory.joint_names.join(", "))?;
    writeln!(out, "points:")?;
    for point in &trajectory.points {
        let Time { secs, nsecs } = point.time_from_start;
        writeln!(out, "- positions: [{}]", list(&point.positions))?;
        writeln!(out, "  velocities: [{}]", list(&point.velocities))?;
        writeln!(out, "  accelerations: []")?;
        writeln!(out, "  effort: []")?;
        writeln!(out, "  time_from_start: {{{whole}: {secs}, {rest}: {nsecs}}}")?;
    }
    Ok(())
}

fn csv(plan: &Plan, out: &mut impl Write) -> io::Result<()> {
    let names = plan.joints.join(",");
    let speeds: Vec<String> = plan.joints.iter().map(|j| format!("{j}_velocity")).collect();
    writeln!(out, "time_from_start,{names},{},patch,contact", speeds.join(","))?;
    let points = trajectory(plan).points;
    let dof = plan.joints.len().min(MAX_DOF);
    for (k, (knot, point)) in plan.knots.iter().zip(&points).enumerate() {
        let Time { secs, nsecs } = point.time_from_start;
        let velocities = list(&knot.v[..dof]).replace(", ", ",");
        writeln!(
            out,
            "{secs}.{nsecs:09},{},{velocities},{},{}",
            list(&point.positions).replace(", ", ","),
            knot.patch.map_or_else(String::new, |p| p.to_string()),
            u8::from(plan.on_surface(k)),
        )?;
    }
    Ok(())
}

/// Without exponents, which YAML 1.1 takes for text.
fn list(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(f64::to_string).collect();
    texts.join(", ")
}
