"""A depth camera that sees a plane: sends clouds on /points and tells where it is on /tf_static."""

import math
import struct

import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

SIDE = 60


def main():
    rclpy.init()
    node = rclpy.create_node("camera")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    frames = node.create_publisher(TFMessage, "/tf_static", latched)
    # 1.2 m above the floor, its optical axis straight down.
    at = TransformStamped(child_frame_id="camera_optical")
    at.header.frame_id = "map"
    at.transform.translation.x, at.transform.translation.z = 0.3, 1.2
    at.transform.rotation.x, at.transform.rotation.w = 1.0, 0.0
    frames.publish(TFMessage(transforms=[at]))
    clouds = node.create_publisher(PointCloud2, "/points", qos_profile_sensor_data)
    data = b""
    for i in range(SIDE):
        for j in range(SIDE):
            z = math.nan if (i, j) == (0, 0) else 0.7
            data += struct.pack("<fff4x", 0.01 * (i - SIDE / 2), 0.01 * (j - SIDE / 2), z)
    names = [PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
             for k, name in enumerate("xyz")]
    cloud = PointCloud2(height=SIDE, width=SIDE, fields=names, point_step=16, row_step=16 * SIDE, data=data)
    cloud.header.frame_id = "camera_optical"
    node.create_timer(0.2, lambda: clouds.publish(cloud))
    rclpy.spin(node)


if __name__ == "__main__":
    main()
