//! For RViz and Foxglove: the arm's frames as it is measured, and a plan's way. A listener to the
//! executor's telemetry, beside whatever moves the arm.

use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use nullsweep_ipc_types::ports::Ipc;
use nullsweep_ipc_types::{JointArray, Telemetry};
use nullsweep_robot::{Arm, JointVector};
use ros2_client::qos::Durability;
use serde::Deserialize;

use crate::args::{Common, ShowArgs};
use crate::domain::{absolute, join, reliable, spin, topic};
use crate::messages::{Header, JointState, Transform};
use crate::pictures::{Color, Frames, Marker, Markers, TransformStamped};
use crate::signals;
use crate::threads::Threads;
use crate::trajectory::ros_time;

/// Time between two looks.
const ROUND: Duration = Duration::from_millis(5);
/// Time between two messages of frames and joints. \[ns\]
const SHOW_NS: u64 = 20_000_000;
/// How wide the line is. \[m\]
const WIDTH: f64 = 0.003;
/// On the surface, and off it.
const CONTACT: Color = [0.1, 0.7, 0.3, 1.0];
const TRANSFER: Color = [0.6, 0.6, 0.6, 0.7];

/// What is read of a plan file.
#[derive(Debug, Deserialize)]
struct Plan {
    fingerprint: String,
    joints: Vec<String>,
    knots: Vec<Knot>,
}

#[derive(Debug, Deserialize)]
struct Knot {
    q: Vec<f64>,
    /// Where the pad is meant to be, on the surface.
    #[serde(default)]
    line: Option<[f64; 3]>,
}

/// Runs until SIGINT or SIGTERM.
pub fn run(common: &Common, args: &ShowArgs) -> anyhow::Result<()> {
    let done = signals::done()?;
    let arm = args.load()?;
    let rename = args.arm.names(&arm)?;
    let names: Vec<String> = arm.joint_names().iter().map(|name| rename(name)).collect();
    let root = arm.robot().links()[arm.robot().root()].name.clone();
    let plan = args.plan.as_deref().map(|path| read(path, &arm)).transpose()?;

    let ipc = Ipc::open(&args.robot_name, args.ipc_root.as_deref())?;
    let telemetry = ipc.telemetry_receiver()?;
    let (mut threads, opened) = Threads::of(|| -> anyhow::Result<_> {
        let mut node = join(common, "nullsweep_show")?;
        let own = topic(&node, "/tf", ("tf2_msgs", "TFMessage"))?;
        let frames = node.create_publisher::<Frames>(&own, Some(reliable(10)))?;
        let latched = reliable(1).durability(Durability::TransientLocal);
        let own = topic(&node, &absolute(&args.topic), ("visualization_msgs", "MarkerArray"))?;
        let markers = node.create_publisher::<Markers>(&own, Some(latched))?;
        let own = topic(&node, "/joint_states", ("sensor_msgs", "JointState"))?;
        let joints = node.create_publisher::<JointState>(&own, Some(reliable(10)))?;
        spin(&mut node)?;
        Ok((node, frames, markers, joints))
    });
    let (_node, frames, markers, joints) = opened?;
    tracing::info!("robot {}: {} from {root}", args.robot_name, args.topic);
    let mut last = 0;
    let mut told: Option<Instant> = None;
    while !done.load(Ordering::Relaxed) {
        std::thread::sleep(ROUND);
        ensure!(
            !threads.has_ended(),
            "the DDS library's threads have ended, as they do in a process that was stopped and goes \
             on: start it again"
        );
        // Told again each second: not everybody asks for what was said before.
        if let Some(plan) = &plan
            && told.is_none_or(|at| at.elapsed() >= Duration::from_secs(1))
        {
            told = Some(Instant::now());
            let _ = markers.publish(Markers { markers: way(plan, &arm, &root) });
        }
        let Some(newest) = telemetry.newest()? else { continue };
        let now = newest.value;
        if now.stamp_ns < last + SHOW_NS {
            continue;
        }
        last = now.stamp_ns;
        if args.publish_tf {
            let _ = frames.publish(placed(&now, &arm, &root));
        }
        if args.publish_joint_states {
            let stamp = ros_time(now.stamp_ns);
            let _ = joints.publish(JointState {
                header: Header { stamp, frame_id: String::new() },
                name: names.clone(),
                position: now.measured[..names.len()].to_vec(),
                ..JointState::default()
            });
        }
        let _ = markers.publish(Markers { markers: vec![tool(&now, &arm, &root)] });
    }
    if threads.has_ended() {
        std::mem::forget(_node);
    }
    Ok(())
}

/// A plan file, of this arm.
fn read(path: &Path, arm: &Arm) -> anyhow::Result<Plan> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let plan: Plan = serde_json::from_str(&text)
        .with_context(|| format!("{} is no plan file", path.display()))?;
    let same = u64::from_str_radix(&plan.fingerprint, 16) == Ok(arm.fingerprint());
    ensure!(
        same && plan.joints == arm.joint_names(),
        "{} was made for another robot or arm: {} … {}",
        path.display(),
        plan.joints.first().map_or("", String::as_str),
        plan.joints.last().map_or("", String::as_str)
    );
    Ok(plan)
}

fn vector(positions: &[f64]) -> JointVector {
    JointVector::from_fn(|j| positions.get(j).copied().unwrap_or(0.0))
}

fn at(arm: &Arm, positions: &JointArray) -> JointVector {
    vector(&positions[..arm.dof()])
}

/// The way of the arm's tip: a point a knot, in the colour of what the tool does there.
fn way(plan: &Plan, arm: &Arm, root: &str) -> Vec<Marker> {
    let stamp = ros_time(nullsweep_ipc_types::ports::now_ns());
    let mut line = Marker::new(root, stamp, ("plan", 0), Marker::LINE_STRIP);
    line.scale = [WIDTH, 0.0, 0.0];
    line.color = CONTACT;
    for knot in &plan.knots {
        let place = arm.tip_pose(&vector(&knot.q)).translation;
        let point = [place.x, place.y, place.z];
        // What moves it by less is not seen, and long messages get lost.
        let far = |last: &[f64; 3]| (0..3).any(|i| (last[i] - point[i]).abs() > WIDTH);
        if line.points.last().is_none_or(far) {
            line.points.push(point);
            line.colors.push(if knot.line.is_some() { CONTACT } else { TRANSFER });
        }
    }
    vec![line]
}

/// Where the tip is commanded to be.
fn tool(now: &Telemetry, arm: &Arm, root: &str) -> Marker {
    let place = arm.tip_pose(&at(arm, &now.commanded)).translation;
    let mut ball = Marker::new(root, ros_time(now.stamp_ns), ("tool", 1), Marker::SPHERE);
    ball.pose.translation = [place.x, place.y, place.z];
    ball.scale = [4.0 * WIDTH; 3];
    ball.color = if now.plan.is_some() { CONTACT } else { TRANSFER };
    ball
}

/// The frames of the links that move, as the arm is measured, from the root.
fn placed(now: &Telemetry, arm: &Arm, root: &str) -> Frames {
    let q = at(arm, &now.measured);
    let robot = arm.robot();
    let links = robot.links();
    let mut poses = vec![arm.tip_pose(&q); links.len()];
    arm.link_poses(&q, &mut poses);
    let stamp = ros_time(now.stamp_ns);
    let frame = |&link: &usize| {
        let (place, turn) = (poses[link].translation, poses[link].rotation);
        TransformStamped {
            header: Header { stamp, frame_id: root.into() },
            child_frame_id: links[link].name.clone(),
            transform: Transform {
                translation: [place.x, place.y, place.z],
                rotation: [turn.i, turn.j, turn.k, turn.w],
            },
        }
    };
    Frames { transforms: arm.moving_links().iter().map(frame).collect() }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use nullsweep_ipc_types::PlanId;
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;

    fn arm() -> Arm {
        Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm")
    }

    #[test]
    fn frames_and_the_tool_are_where_the_arm_is() {
        let arm = arm();
        let mut now = Telemetry::zeroed();
        now.measured[..7].copy_from_slice(&arm.home()[..7]);
        now.commanded = now.measured;
        now.plan = PlanId { epoch: 1, number: 1 };
        let frames = placed(&now, &arm, "base_footprint");
        assert_eq!(frames.transforms.len(), arm.moving_links().len());
        let tip = arm.tip_pose(&arm.home());
        let found = frames.transforms.iter().find(|f| f.child_frame_id == arm.spec().tip);
        let place = found.expect("the tip's frame").transform;
        for (i, wanted) in
            [tip.translation.x, tip.translation.y, tip.translation.z].iter().enumerate()
        {
            assert!((place.translation[i] - wanted).abs() < 1e-12, "{place:?}");
        }
        let norm: f64 = place.rotation.iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-9);
        let ball = tool(&now, &arm, "base_footprint");
        let apart = |i: usize| (ball.pose.translation[i] - place.translation[i]).abs();
        assert!((0..3).all(|i| apart(i) < 1e-12) && ball.color == CONTACT, "{ball:?}");
    }

    #[test]
    fn a_plans_way_has_a_point_where_the_tip_has_moved() {
        let arm = arm();
        let knot = |by: f64, line| {
            let mut q = arm.home()[..7].to_vec();
            q[0] += by;
            Knot { q, line }
        };
        let knots = vec![knot(0.0, None), knot(1e-6, None), knot(0.1, Some([0.0; 3]))];
        let plan = Plan { fingerprint: String::new(), joints: Vec::new(), knots };
        let line = &way(&plan, &arm, "base_footprint")[0];
        assert_eq!((line.points.len(), &line.colors[..]), (2, &[TRANSFER, CONTACT][..]));
        assert_eq!(
            (line.kind, line.header.frame_id.as_str()),
            (Marker::LINE_STRIP, "base_footprint")
        );
    }
}
