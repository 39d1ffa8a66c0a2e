"""Reads an MCAP log of `planner view --mcap` with the format's own Python library, which shares no line with
what wrote it: every message is decoded by the schema that the file holds. Run by tests/page/run."""

import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

# What Foxglove and rerun take for a robot, its motion, a path and points.
KINDS = {
    "/robot": "visualization_msgs/msg/MarkerArray",
    "/around": "visualization_msgs/msg/MarkerArray",
    "/path": "nav_msgs/msg/Path",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/measured/joint_states": "sensor_msgs/msg/JointState",
}


def check(path):
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        promised = reader.get_summary().statistics.channel_message_counts
        count, frames, shown = {}, {"root"}, set()
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic
            kind = "sensor_msgs/msg/PointCloud2" if topic.startswith("/scan/") else KINDS[topic]
            assert (schema.name, schema.encoding, channel.message_encoding) == (kind, "ros2msg", "cdr"), topic
            count[channel.id] = count.get(channel.id, 0) + 1
            if topic == "/tf":
                for moved in decoded.transforms:
                    assert moved.header.frame_id in frames
                    q = moved.transform.rotation
                    assert abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 1e-9
                    frames.add(moved.child_frame_id)
            elif topic.endswith("joint_states"):
                assert len(decoded.name) == len(decoded.position) == len(decoded.velocity) > 0
                stamp = decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
                assert stamp == message.log_time
            elif topic.startswith("/scan/"):
                assert len(decoded.data) == decoded.width * decoded.point_step == decoded.row_step
                assert [field.name for field in decoded.fields] == ["x", "y", "z"]
            elif topic in ("/robot", "/around"):
                assert len({(marker.ns, marker.id) for marker in decoded.markers}) == len(decoded.markers)
                for marker in decoded.markers:
                    assert marker.type == 11 and len(marker.points) % 3 == 0
                    shown.add(marker.header.frame_id)
        assert count == promised, "a message did not decode"
        assert shown <= frames, f"no transform leads to {shown - frames}"
        print(f"ok   {sum(count.values())} messages on {len(count)} topics decode by their own schemas")


check(sys.argv[1])
