//! ROS 2's messages for those who look: frames and markers, field by field as their definitions have
//! them.

use ros2_client::Message;
use serde::{Deserialize, Serialize};

use crate::messages::{Duration, Header, Time, Transform, Vector3};

/// `geometry_msgs/TransformStamped`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

/// `tf2_msgs/TFMessage`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    pub transforms: Vec<TransformStamped>,
}
impl Message for Frames {}

/// `std_msgs/ColorRGBA`
pub type Color = [f32; 4];

/// `sensor_msgs/CompressedImage`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    pub header: Header,
    pub format: String,
    pub data: Vec<u8>,
}

/// `visualization_msgs/MeshFile`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshFile {
    pub filename: String,
    pub data: Vec<u8>,
}

/// `visualization_msgs/Marker`: `pose` is a place and a quaternion x, y, z, w.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    pub header: Header,
    pub ns: String,
    pub id: i32,
    pub kind: i32,
    pub action: i32,
    pub pose: Transform,
    pub scale: Vector3,
    pub color: Color,
    pub lifetime: Duration,
    pub frame_locked: bool,
    pub points: Vec<Vector3>,
    pub colors: Vec<Color>,
    pub texture_resource: String,
    pub texture: Image,
    pub uv_coordinates: Vec<[f32; 2]>,
    pub text: String,
    pub mesh_resource: String,
    pub mesh_file: MeshFile,
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// A line through points.
    pub const LINE_STRIP: i32 = 4;
    /// A ball.
    pub const SPHERE: i32 = 2;

    /// One at the origin of a frame, for good.
    pub fn new(frame: &str, stamp: Time, (ns, id): (&str, i32), kind: i32) -> Self {
        Self {
            header: Header { stamp, frame_id: frame.into() },
            ns: ns.into(),
            id,
            kind,
            pose: Transform { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] },
            ..Self::default()
        }
    }
}

/// `visualization_msgs/MarkerArray`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Markers {
    pub markers: Vec<Marker>,
}
impl Message for Markers {}
