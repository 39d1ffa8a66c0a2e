//! Formats that are known but not read, and how to get from them to one that is.

use std::path::Path;

/// A format's name, how its files end and begin, and a command that converts one.
struct Foreign {
    name: &'static str,
    extensions: &'static [&'static str],
    begins: &'static [u8],
    convert: &'static str,
}

const FOREIGN: [Foreign; 4] = [
    Foreign {
        name: "3MF",
        extensions: &["3mf"],
        // It is a zip file, as much else is.
        begins: b"",
        convert: "assimp export FILE out.stl",
    },
    Foreign {
        name: "DAE, FBX or 3DS mesh",
        extensions: &["dae", "fbx", "3ds"],
        begins: b"Kaydara FBX",
        convert: "assimp export FILE out.ply",
    },
    Foreign {
        name: "ROS 1 bag",
        extensions: &["bag"],
        begins: b"#ROSBAG",
        convert: "rosrun pcl_ros bag_to_pcd FILE TOPIC .",
    },
    Foreign {
        name: "ROS 2 bag",
        extensions: &["mcap", "db3"],
        begins: b"",
        convert: "ros2 run pcl_ros bag_to_pcd --ros-args -p bag_path:=FILE -p topic_name:=TOPIC -p \
                  output_directory:=.",
    },
];

/// The name of a known format that is not read, and the command that converts this file.
pub(super) fn detect(path: &Path, bytes: &[u8]) -> Option<(&'static str, String)> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let is = |f: &&Foreign| {
        f.extensions.contains(&extension.as_str())
            || (!f.begins.is_empty() && bytes.starts_with(f.begins))
    };
    let foreign = FOREIGN.iter().find(is)?;
    Some((foreign.name, foreign.convert.replace("FILE", &path.display().to_string())))
}
