//! The ROS 2 messages of a log: their fields in order, and the text that tells a reader of them.

use nalgebra::{Isometry3, Point3};
use serde::Serialize;

/// A message with its definition.
pub(super) trait Message: Serialize {
    /// Package and name.
    const NAME: &'static str;
    /// Its own fields.
    const FIELDS: &'static str;
    /// The types that it is made of.
    const PARTS: &'static [Part];

    /// Its definition with those of its parts.
    fn schema() -> String {
        let rule = "=".repeat(80);
        let parts = Self::PARTS.iter();
        let parts = parts.map(|(name, fields)| format!("{rule}\nMSG: {name}\n{fields}\n"));
        format!("{}\n{}", Self::FIELDS, parts.collect::<String>())
    }
}

/// Name and fields of a type.
type Part = (&'static str, &'static str);

const TIME: Part = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec");
const DURATION: Part = ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec");
const HEADER: Part = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id");
const COLOUR: Part = ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a");
const VECTOR: Part = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z");
const POINT: Part = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z");
const QUATERNION: Part = ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w");
const TRANSFORM: Part = (
    "geometry_msgs/Transform",
    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
);
const STAMPED: Part = (
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
);
const POSE: Part =
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation");
const POSE_STAMPED: Part =
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose");
const FIELD: Part =
    ("sensor_msgs/PointField", "string name\nuint32 offset\nuint8 datatype\nuint32 count");
const MARKER: Part = (
    "visualization_msgs/Marker",
    "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n\
     geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n\
     builtin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n\
     std_msgs/ColorRGBA[] colors\nstring text\nstring mesh_resource\n\
     bool mesh_use_embedded_materials",
);

/// `type` of a marker of triangles.
pub(super) const TRIANGLE_LIST: i32 = 11;
/// `datatype` of a field of 32-bit numbers.
pub(super) const FLOAT32: u8 = 7;

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Time {
    pub(super) sec: i32,
    pub(super) nanosec: u32,
}

#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Header {
    pub(super) stamp: Time,
    pub(super) frame_id: String,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Colour {
    pub(super) r: f32,
    pub(super) g: f32,
    pub(super) b: f32,
    pub(super) a: f32,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Vector3 {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// Both a `Transform` and a `Pose`, which have the same fields under other names.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Placed {
    position: Vector3,
    orientation: Quaternion,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct TransformStamped {
    pub(super) header: Header,
    pub(super) child_frame_id: String,
    pub(super) transform: Placed,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct TfMessage {
    pub(super) transforms: Vec<TransformStamped>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct JointState {
    pub(super) header: Header,
    pub(super) name: Vec<String>,
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) effort: Vec<f64>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct PoseStamped {
    pub(super) header: Header,
    pub(super) pose: Placed,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Path {
    pub(super) header: Header,
    pub(super) poses: Vec<PoseStamped>,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct PointField {
    pub(super) name: String,
    pub(super) offset: u32,
    pub(super) datatype: u8,
    pub(super) count: u32,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct PointCloud2 {
    pub(super) header: Header,
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) fields: Vec<PointField>,
    pub(super) is_bigendian: bool,
    pub(super) point_step: u32,
    pub(super) row_step: u32,
    pub(super) data: Vec<u8>,
    pub(super) is_dense: bool,
}

#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Marker {
    pub(super) header: Header,
    pub(super) ns: String,
    pub(super) id: i32,
    pub(super) kind: i32,
    pub(super) action: i32,
    pub(super) pose: Placed,
    pub(super) scale: Vector3,
    pub(super) color: Colour,
    pub(super) lifetime: Time,
    pub(super) frame_locked: bool,
    pub(super) points: Vec<Vector3>,
    pub(super) colors: Vec<Colour>,
    pub(super) text: String,
    pub(super) mesh_resource: String,
    pub(super) mesh_use_embedded_materials: bool,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct MarkerArray {
    pub(super) markers: Vec<Marker>,
}

impl From<Point3<f64>> for Vector3 {
    fn from(p: Point3<f64>) -> Self {
        Self { x: p.x, y: p.y, z: p.z }
    }
}

impl From<Isometry3<f64>> for Placed {
    fn from(pose: Isometry3<f64>) -> Self {
        let r = pose.rotation;
        Self {
            position: Point3::from(pose.translation.vector).into(),
            orientation: Quaternion { x: r.i, y: r.j, z: r.k, w: r.w },
        }
    }
}

impl Message for TfMessage {
    const NAME: &'static str = "tf2_msgs/msg/TFMessage";
    const FIELDS: &'static str = "geometry_msgs/TransformStamped[] transforms";
    const PARTS: &'static [Part] = &[STAMPED, HEADER, TIME, TRANSFORM, VECTOR, QUATERNION];
}

impl Message for JointState {
    const NAME: &'static str = "sensor_msgs/msg/JointState";
    const FIELDS: &'static str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort";
    const PARTS: &'static [Part] = &[HEADER, TIME];
}

impl Message for Path {
    const NAME: &'static str = "nav_msgs/msg/Path";
    const FIELDS: &'static str = "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses";
    const PARTS: &'static [Part] = &[HEADER, TIME, POSE_STAMPED, POSE, POINT, QUATERNION];
}

impl Message for PointCloud2 {
    const NAME: &'static str = "sensor_msgs/msg/PointCloud2";
    const FIELDS: &'static str = "std_msgs/Header header\nuint32 height\nuint32 width\n\
         sensor_msgs/PointField[] fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\n\
         uint8[] data\nbool is_dense";
    const PARTS: &'static [Part] = &[HEADER, TIME, FIELD];
}

impl Message for MarkerArray {
    const NAME: &'static str = "visualization_msgs/msg/MarkerArray";
    const FIELDS: &'static str = "visualization_msgs/Marker[] markers";
    const PARTS: &'static [Part] =
        &[MARKER, HEADER, TIME, DURATION, COLOUR, POSE, POINT, QUATERNION, VECTOR];
}
