//! The same data as an MCAP log, for Foxglove, rerun and whatever else reads ROS 2 messages: robot,
//! joint states, transforms, path and points.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use byteorder::LittleEndian;
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use nalgebra::{Isometry3, Point3, UnitQuaternion};
use serde::Serialize;

use crate::data::{Cloud, Look, Motion, Paint, ReportData, ReportError, Shape};
use crate::ros::{self, Message};

/// Joint states and transforms a second.
const RATE: f64 = 50.0;
/// The frame that all is in: the robot's root.
const ROOT: &str = "root";

/// Why a log could not be written.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file could not be written.
    #[error("{}: the log cannot be written", path.display())]
    Io {
        /// The file.
        path: std::path::PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The log's own format was not kept.
    #[error(transparent)]
    Format(#[from] mcap::McapError),
    /// A message could not be put into bytes.
    #[error("a message cannot be put into bytes: {0}")]
    Message(String),
    /// The data do not fit together.
    #[error(transparent)]
    Data(#[from] ReportError),
}

/// Writes an MCAP log of ROS 2 messages (CDR), time 0 at the first plan's start: `/tf`,
/// `/joint_states` and `/measured/joint_states` at 50 Hz; `/robot` and `/around` (markers), `/path`
/// and a cloud each under `/scan/` once.
///
/// # Errors
/// [`LogError`] if the data do not fit together or the file cannot be written.
pub fn write_log(path: &Path, data: &ReportData) -> Result<(), LogError> {
    data.check()?;
    let file = File::create(path).map_err(|source| LogError::Io { path: path.into(), source })?;
    let options = WriteOptions::new().compression(None).profile("ros2").library("nullsweep");
    let mut log = Log { writer: options.create(BufWriter::new(file))?, channels: BTreeMap::new() };
    for (topic, moves) in [("/robot", true), ("/around", false)] {
        let shapes = data.shapes.iter().filter(|shape| is_robot(shape) == moves);
        let markers = shapes.enumerate().map(|(id, shape)| marker(id, shape)).collect();
        log.put(topic, 0.0, &ros::MarkerArray { markers })?;
    }
    for cloud in data.clouds.iter().filter(|cloud| !cloud.points.is_empty()) {
        log.put(&format!("/scan/{}", topic_name(cloud)), 0.0, &points(&cloud.points))?;
    }
    log.put("/path", 0.0, &whole_path(data))?;
    for motion in &data.measured {
        for time in samples(motion) {
            let state = joint_state(data, motion, time);
            log.put("/measured/joint_states", motion.starts_at + time, &state)?;
        }
    }
    for (i, motion) in data.plans.iter().enumerate() {
        let until = data.plans.get(i + 1).map_or(f64::INFINITY, |next| next.starts_at);
        for time in samples(motion).take_while(|time| motion.starts_at + time < until) {
            let now = motion.starts_at + time;
            let state = joint_state(data, motion, time);
            let poses = bodies_at(data, &state.position);
            let moved = poses.iter().enumerate().map(|(body, pose)| ros::TransformStamped {
                header: header(now, ROOT),
                child_frame_id: frame(Some(body)),
                transform: (*pose).into(),
            });
            log.put("/tf", now, &ros::TfMessage { transforms: moved.collect() })?;
            log.put("/joint_states", now, &state)?;
        }
    }
    log.writer.finish()?;
    Ok(())
}

struct Log {
    writer: Writer<BufWriter<File>>,
    /// For each topic its channel and how many messages it has.
    channels: BTreeMap<String, (u16, u32)>,
}

impl Log {
    fn put<M: Message>(&mut self, topic: &str, seconds: f64, message: &M) -> Result<(), LogError> {
        if !self.channels.contains_key(topic) {
            let schema = self.writer.add_schema(M::NAME, "ros2msg", M::schema().as_bytes())?;
            let channel = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
            self.channels.insert(topic.into(), (channel, 0));
        }
        let (channel_id, sequence) = self.channels[topic];
        self.channels.insert(topic.into(), (channel_id, sequence + 1));
        let time = (seconds * 1e9).round() as u64;
        let head = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&head, &cdr(message)?)?;
        Ok(())
    }
}

/// A message as little-endian CDR behind its four bytes of header.
fn cdr<M: Serialize>(message: &M) -> Result<Vec<u8>, LogError> {
    let mut bytes = vec![0, 1, 0, 0];
    let body = cdr_encoding::to_vec::<M, LittleEndian>(message)
        .map_err(|error| LogError::Message(error.to_string()))?;
    bytes.extend(body);
    Ok(bytes)
}

fn is_robot(shape: &Shape) -> bool {
    !matches!(shape.look, Look::Obstacle | Look::Ground)
}

fn frame(body: Option<usize>) -> String {
    body.map_or_else(|| ROOT.into(), |body| format!("body_{body}"))
}

fn header(seconds: f64, frame_id: &str) -> ros::Header {
    let nanoseconds = (seconds * 1e9).round() as u64;
    let (sec, nanosec) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
    let stamp = ros::Time { sec: sec as i32, nanosec: nanosec as u32 };
    ros::Header { stamp, frame_id: frame_id.into() }
}

fn topic_name(cloud: &Cloud) -> String {
    match cloud.paint {
        Paint::Swept => "swept".into(),
        Paint::Left => "left".into(),
        Paint::Unseen => "unseen".into(),
        Paint::Around => "around".into(),
        Paint::Numbered(n) => format!("object_{}", n + 1),
    }
}

fn marker(id: usize, shape: &Shape) -> ros::Marker {
    let [r, g, b, a] = match shape.look {
        Look::Robot => [0.76, 0.79, 0.83, 1.0],
        Look::Pad => [0.91, 0.76, 0.24, 1.0],
        Look::Guessed => [0.85, 0.6, 0.42, 1.0],
        Look::Obstacle => [0.72, 0.56, 0.43, 0.5],
        Look::Ground => [0.83, 0.85, 0.88, 0.6],
    };
    let corners = shape.triangles.iter().flatten().map(|c| shape.vertices[*c as usize].into());
    ros::Marker {
        header: header(0.0, &frame(shape.body)),
        ns: shape.name.clone(),
        id: id as i32,
        kind: ros::TRIANGLE_LIST,
        pose: Isometry3::identity().into(),
        scale: ros::Vector3 { x: 1.0, y: 1.0, z: 1.0 },
        color: ros::Colour { r, g, b, a },
        frame_locked: true,
        points: corners.collect(),
        ..ros::Marker::default()
    }
}

fn points(points: &[Point3<f64>]) -> ros::PointCloud2 {
    let field = |name: &str, offset| ros::PointField {
        name: name.into(),
        offset,
        datatype: ros::FLOAT32,
        count: 1,
    };
    let coordinates = points.iter().flat_map(|p| [p.x, p.y, p.z]);
    ros::PointCloud2 {
        header: header(0.0, ROOT),
        height: 1,
        width: points.len() as u32,
        fields: vec![field("x", 0), field("y", 4), field("z", 8)],
        is_bigendian: false,
        point_step: 12,
        row_step: 12 * points.len() as u32,
        data: coordinates.flat_map(|c| (c as f32).to_le_bytes()).collect(),
        is_dense: true,
    }
}

/// The pad's path of all plans, each until the next one takes over.
fn whole_path(data: &ReportData) -> ros::Path {
    let mut poses = Vec::new();
    for (i, motion) in data.plans.iter().enumerate() {
        let until = data.plans.get(i + 1).map_or(f64::INFINITY, |next| next.starts_at);
        for time in samples(motion).take_while(|time| motion.starts_at + time < until) {
            let Some(pad) = &data.pad else { break };
            let pose = bodies_at(data, &joints_at(motion, time).0)[pad.body];
            let at = pose * pad.centre;
            poses.push(ros::PoseStamped {
                header: header(motion.starts_at + time, ROOT),
                pose: Isometry3::from_parts(at.into(), pose.rotation).into(),
            });
        }
    }
    ros::Path { header: header(0.0, ROOT), poses }
}

/// Times of a motion, its end among them. \[s\]
fn samples(motion: &Motion) -> impl Iterator<Item = f64> + use<> {
    let end = motion.times.last().copied();
    let steps = end.map_or(0, |end| (end * RATE).ceil() as usize);
    (0..steps).map(|k| k as f64 / RATE).chain(end)
}

fn joint_state(data: &ReportData, motion: &Motion, time: f64) -> ros::JointState {
    let (position, velocity) = joints_at(motion, time);
    ros::JointState {
        header: header(motion.starts_at + time, ROOT),
        name: data.joints.iter().map(|joint| joint.name.clone()).collect(),
        position,
        velocity,
        effort: Vec::new(),
    }
}

/// Positions and velocities at a time of a motion: on the straight line between two knots, or on
/// the cubic with their velocities.
fn joints_at(motion: &Motion, time: f64) -> (Vec<f64>, Vec<f64>) {
    let last = motion.times.len() - 1;
    let next = motion.times.partition_point(|t| *t <= time).clamp(last.min(1), last);
    let before = next.saturating_sub(1);
    let span = motion.times[next] - motion.times[before];
    let u = if span > 0.0 { ((time - motion.times[before]) / span).clamp(0.0, 1.0) } else { 0.0 };
    let one = |j: usize| {
        let (a, b) = (motion.joints[j][before], motion.joints[j][next]);
        let difference = b - a;
        if motion.velocities.is_empty() || span == 0.0 {
            return (a + u * difference, if span > 0.0 { difference / span } else { 0.0 });
        }
        let [va, vb] = [before, next].map(|k| motion.velocities[j][k] * span);
        // As the executor has it: a knot is hit to the bit.
        let ends = |at: f64| if u >= 1.0 { b } else { at };
        let (c, d) = (3.0 * difference - 2.0 * va - vb, va + vb - 2.0 * difference);
        (ends(a + u * (va + u * (c + u * d))), (va + u * (2.0 * c + 3.0 * u * d)) / span)
    };
    (0..motion.joints.len()).map(one).unzip()
}

/// Poses of the bodies in the root frame.
fn bodies_at(data: &ReportData, q: &[f64]) -> Vec<Isometry3<f64>> {
    let mut poses: Vec<Isometry3<f64>> = Vec::with_capacity(data.bodies.len());
    for body in &data.bodies {
        let value = body.factor * q[body.joint] + body.offset;
        let (turn, slide) = if body.slides { (0.0, value) } else { (value, 0.0) };
        let motion = Isometry3::from_parts(
            body.axis.scale(slide).into(),
            UnitQuaternion::from_axis_angle(&body.axis, turn),
        );
        let local = body.rest * motion;
        poses.push(body.parent.map_or(local, |parent| poses[parent] * local));
    }
    poses
}
