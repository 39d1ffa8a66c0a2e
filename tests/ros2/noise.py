"""Others in a ROS 2 domain who talk much: a gripper's joint states, trajectories for somebody else,
and, with `--with-arm`, joint states of an arm of the same names that stands elsewhere.
"""

import sys
import time

import rclpy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ARM = [f"{side}_{joint}_joint" for side in "rl" for joint in (
    "shoulder_pan", "shoulder_lift", "upper_arm_roll", "elbow_flex", "forearm_roll", "wrist_flex",
    "wrist_roll")] + ["elbow"]


def main():
    rclpy.init()
    node = rclpy.create_node("noise")
    states = node.create_publisher(JointState, "/joint_states", 10)
    others = node.create_publisher(JointTrajectory, "/other_controller/joint_trajectory", 10)
    node.create_subscription(JointTrajectory, "/other_controller/joint_trajectory", lambda m: None, 10)
    names = ARM if "--with-arm" in sys.argv else ["some_gripper"]
    trajectory = JointTrajectory(joint_names=names)
    trajectory.points = [JointTrajectoryPoint(positions=[0.0] * len(names)) for _ in range(50)]
    while rclpy.ok():
        state = JointState(name=names, position=[1.0] * len(names))
        now = time.time()
        state.header.stamp.sec, state.header.stamp.nanosec = int(now), int((now % 1) * 1e9)
        states.publish(state)
        others.publish(trajectory)
        rclpy.spin_once(node, timeout_sec=0.0)
        time.sleep(0.01)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
