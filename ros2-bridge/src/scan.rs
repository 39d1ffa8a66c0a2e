//! A scan for the planner: one cloud of a sensor_msgs/PointCloud2 topic as a PCD file, with the sensor's
//! pose by TF.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use ros2_client::Message;
use ros2_client::qos::Durability;
use serde::{Deserialize, Serialize};

use crate::args::{Common, ScanArgs};
use crate::domain::{absolute, join, newest, reliable, spin, topic};
use crate::messages::{Header, Transform};
use crate::pictures::Frames;

/// Time between two looks.
const ROUND: Duration = Duration::from_millis(5);
/// `sensor_msgs/PointField`'s numbers for what can be read here.
const FLOAT32: u8 = 7;
const FLOAT64: u8 = 8;

/// `sensor_msgs/PointField`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Field {
    name: String,
    offset: u32,
    datatype: u8,
    count: u32,
}

/// `sensor_msgs/PointCloud2`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Cloud {
    header: Header,
    height: u32,
    width: u32,
    fields: Vec<Field>,
    is_bigendian: bool,
    point_step: u32,
    row_step: u32,
    data: Vec<u8>,
    is_dense: bool,
}
impl Message for Cloud {}

/// Waits for a cloud, and for the sensor's pose where that is asked for, and writes the file.
pub fn run(common: &Common, args: &ScanArgs) -> anyhow::Result<()> {
    let mut node = join(common, "nullsweep_scan")?;
    let own = topic(&node, &absolute(&args.topic), ("sensor_msgs", "PointCloud2"))?;
    let clouds = node.create_subscription::<Cloud>(&own, Some(newest(2)))?;
    let kind = ("tf2_msgs", "TFMessage");
    let own = topic(&node, "/tf", kind)?;
    let moving = node.create_subscription::<Frames>(&own, Some(newest(100)))?;
    let latched = reliable(100).durability(Durability::TransientLocal);
    let own = topic(&node, "/tf_static", kind)?;
    let fixed = node.create_subscription::<Frames>(&own, Some(latched))?;
    spin(&mut node)?;
    let (began, mut tree, mut cloud) = (Instant::now(), Tree::default(), None);
    while began.elapsed() < args.timeout {
        std::thread::sleep(ROUND);
        for frames in [&moving, &fixed] {
            while let Ok(Some((message, _))) = frames.take() {
                tree.take(message);
            }
        }
        while let Ok(Some((message, _))) = clouds.take() {
            cloud = Some(message);
        }
        let Some(cloud) = &cloud else { continue };
        let pose = match &args.frame {
            Some(frame) => tree.pose(&cloud.header.frame_id, frame),
            None => Some(Isometry3::identity()),
        };
        let Some(pose) = pose else { continue };
        let points = points(cloud)?;
        let file = std::fs::File::create(&args.out);
        let write = |mut file: std::fs::File| file.write_all(&pcd(&points, &pose));
        file.and_then(write).with_context(|| format!("cannot write {}", args.out.display()))?;
        let (seen, all) = (points.len(), cloud.width as usize * cloud.height as usize);
        println!("{}: {seen} points of {all}", args.out.display());
        if let Some(frame) = &args.frame {
            println!("as measured in {}, which is in {frame} at", cloud.header.frame_id);
            println!("--sensor-pose {}", flag(&pose));
        }
        return Ok(());
    }
    let seconds = args.timeout.as_secs_f64();
    match (cloud, &args.frame) {
        (Some(cloud), Some(frame)) => bail!(
            "no way from {} to {frame} on /tf and /tf_static within {seconds:.0} s; known are: {}",
            cloud.header.frame_id,
            tree.known()
        ),
        _ => bail!(
            "no cloud came on {} within {seconds:.0} s. Is it sent, in this domain (ROS_DOMAIN_ID), on this \
             network?",
            args.topic
        ),
    }
}

/// Frames, by child: the parent, and the pose in it.
#[derive(Debug, Default)]
struct Tree(BTreeMap<String, (String, Isometry3<f64>)>);

impl Tree {
    fn take(&mut self, frames: Frames) {
        for frame in frames.transforms {
            let pose = isometry(&frame.transform);
            self.0.insert(frame.child_frame_id, (frame.header.frame_id, pose));
        }
    }

    /// A frame's root, and its pose there.
    fn root<'a>(&'a self, frame: &'a str) -> Option<(&'a str, Isometry3<f64>)> {
        let (mut at, mut pose) = (frame, Isometry3::identity());
        // A tree has no longer way than it has frames.
        for _ in 0..=self.0.len() {
            let Some((parent, in_parent)) = self.0.get(at) else { return Some((at, pose)) };
            (at, pose) = (parent, in_parent * pose);
        }
        None
    }

    /// A frame's pose in another one, if they hang together.
    fn pose(&self, frame: &str, in_frame: &str) -> Option<Isometry3<f64>> {
        let (root, pose) = self.root(frame)?;
        let (other, base) = self.root(in_frame)?;
        (root == other).then(|| base.inverse() * pose)
    }

    fn known(&self) -> String {
        let pairs: Vec<_> =
            self.0.iter().map(|(child, (parent, _))| format!("{child} in {parent}")).collect();
        if pairs.is_empty() { "none".into() } else { pairs.join(", ") }
    }
}

fn isometry(transform: &Transform) -> Isometry3<f64> {
    let [x, y, z] = transform.translation;
    let [i, j, k, w] = transform.rotation;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}

/// The points that were measured: those whose numbers are some. \[m\]
fn points(cloud: &Cloud) -> anyhow::Result<Vec<[f32; 3]>> {
    let fields: Vec<_> = cloud.fields.iter().map(|f| f.name.as_str()).collect();
    let find = |name: &str| {
        let field = cloud.fields.iter().find(|f| f.name == name);
        let read = field.filter(|f| matches!(f.datatype, FLOAT32 | FLOAT64));
        read.with_context(|| format!("the cloud has no {name} of float32 or float64: {fields:?}"))
    };
    let [x, y, z] = [find("x")?, find("y")?, find("z")?];
    let (step, row) = (cloud.point_step as usize, cloud.row_step as usize);
    let rows = cloud.height as usize;
    let width = cloud.width as usize;
    let bytes =
        |field: &Field| field.offset as usize + if field.datatype == FLOAT32 { 4 } else { 8 };
    let fits = [x, y, z].iter().all(|f| bytes(f) <= step)
        && row >= step * width
        && cloud.data.len() >= row * rows;
    ensure!(
        fits,
        "the cloud's sizes do not fit: {width} × {rows} points of {step} bytes in rows of {row}"
    );
    let number = |at: usize, field: &Field| {
        let at = at + field.offset as usize;
        let mut bytes = [0; 8];
        let size = if field.datatype == FLOAT32 { 4 } else { 8 };
        bytes[..size].copy_from_slice(&cloud.data[at..at + size]);
        if cloud.is_bigendian {
            bytes[..size].reverse();
        }
        if size == 8 {
            f64::from_le_bytes(bytes) as f32
        } else {
            f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        }
    };
    let places = (0..rows).flat_map(|r| (0..width).map(move |c| r * row + c * step));
    let all = places.map(|at| [number(at, x), number(at, y), number(at, z)]);
    Ok(all.filter(|point| point.iter().all(|v| v.is_finite())).collect())
}

/// A pose as the planner's `--sensor-pose` takes it.
fn flag(pose: &Isometry3<f64>) -> String {
    let (place, turn) = (pose.translation, pose.rotation);
    let all = [place.x, place.y, place.z, turn.i, turn.j, turn.k, turn.w];
    all.map(|value| value.to_string()).join(",")
}

/// A binary PCD file, its viewpoint the sensor's pose.
fn pcd(points: &[[f32; 3]], pose: &Isometry3<f64>) -> Vec<u8> {
    let (place, turn) = (pose.translation, pose.rotation);
    let count = points.len();
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\n\
         HEIGHT 1\nVIEWPOINT {} {} {} {} {} {} {}\nPOINTS {count}\nDATA binary\n",
        place.x, place.y, place.z, turn.w, turn.i, turn.j, turn.k
    )
    .into_bytes();
    bytes.extend(points.iter().flatten().flat_map(|value| value.to_le_bytes()));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::TransformStamped;

    fn frame(parent: &str, child: &str, x: f64, turn: [f64; 4]) -> TransformStamped {
        TransformStamped {
            header: Header { frame_id: parent.into(), ..Header::default() },
            child_frame_id: child.into(),
            transform: Transform { translation: [x, 0.0, 0.0], rotation: turn },
        }
    }

    #[test]
    fn a_frames_pose_is_found_over_their_common_root() {
        let none = [0.0, 0.0, 0.0, 1.0];
        let half = [0.0, 0.0, 1.0, 0.0];
        let mut tree = Tree::default();
        tree.take(Frames {
            transforms: vec![
                frame("map", "base", 1.0, half),
                frame("base", "camera", 0.5, none),
                frame("map", "table", 3.0, none),
                frame("alone", "other", 1.0, none),
            ],
        });
        let at = |frame: &str, other: &str| tree.pose(frame, other).map(|p| p.translation.x);
        assert_eq!(at("camera", "base"), Some(0.5));
        // Turned by half a turn, it looks the other way.
        assert!((at("camera", "map").expect("a way") - 0.5).abs() < 1e-12);
        assert!((at("camera", "table").expect("a way") + 2.5).abs() < 1e-12);
        assert_eq!((at("camera", "other"), at("nobody", "map")), (None, None));
        assert!(tree.known().contains("camera in base"));
        tree.take(Frames { transforms: vec![frame("camera", "map", 0.0, none)] });
        assert_eq!(tree.pose("camera", "base"), None, "a circle is no way");
    }

    fn cloud(is_bigendian: bool) -> Cloud {
        let field =
            |name: &str, offset, datatype| Field { name: name.into(), offset, datatype, count: 1 };
        let mut data = Vec::new();
        for [x, y, z] in [[1.0_f32, 2.0, 3.0], [f32::NAN, 0.0, 0.0]] {
            for value in [x, y] {
                data.extend(if is_bigendian { value.to_be_bytes() } else { value.to_le_bytes() });
            }
            data.extend([9; 4]);
            let z = f64::from(z);
            data.extend(if is_bigendian { z.to_be_bytes() } else { z.to_le_bytes() });
        }
        let fields =
            vec![field("x", 0, 7), field("y", 4, 7), field("rgb", 8, 7), field("z", 12, 8)];
        let (height, width) = (2, 1);
        Cloud {
            height,
            width,
            fields,
            is_bigendian,
            point_step: 20,
            row_step: 20,
            data,
            ..Cloud::default()
        }
    }

    #[test]
    fn a_cloud_is_read_by_its_fields() {
        for is_bigendian in [false, true] {
            assert_eq!(points(&cloud(is_bigendian)).expect("points"), [[1.0, 2.0, 3.0]]);
        }
        let short = Cloud { width: 2, ..cloud(false) };
        assert!(points(&short).unwrap_err().to_string().contains("do not fit"));
        let mut other = cloud(false);
        other.fields[3].datatype = 2;
        assert!(points(&other).unwrap_err().to_string().contains("no z of float32"));
        let text = pcd(&[[1.0, 2.0, 3.0]], &Isometry3::translation(0.5, 0.0, 1.0));
        let head = String::from_utf8_lossy(&text[..text.len() - 12]).into_owned();
        assert!(head.contains("VIEWPOINT 0.5 0 1 1 0 0 0\nPOINTS 1\n"), "{head}");
        assert_eq!(text[text.len() - 4..], 3.0_f32.to_le_bytes());
        assert_eq!(flag(&Isometry3::translation(0.5, 0.0, 1.0)), "0.5,0,1,0,0,0,1");
    }
}
