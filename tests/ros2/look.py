"""What RViz would see: frames and markers of `ros2-bridge show`. Writes what came as JSON when it is
ended."""

import argparse
import json
import math
import signal
import time

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", required=True)
    parser.add_argument("--topic", default="/nullsweep/markers")
    args = parser.parse_args()
    done = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: done.append(1))
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = rclpy.create_node("look")
    seen = {"messages": 0, "frames": [], "root": "", "unit": True, "points": 0, "colours": 0, "balls": 0,
            "moved": 0.0}
    last = {"ball": None}

    def frames(message):
        seen["messages"] += 1
        seen["frames"] = [t.child_frame_id for t in message.transforms]
        seen["root"] = message.transforms[0].header.frame_id
        for t in message.transforms:
            r = t.transform.rotation
            seen["unit"] = seen["unit"] and abs(math.hypot(r.x, r.y, r.z, r.w) - 1) < 1e-6

    def markers(message):
        for marker in message.markers:
            if marker.type == Marker.LINE_STRIP:
                seen["points"], seen["colours"] = len(marker.points), len({c.g for c in marker.colors})
            elif marker.type == Marker.SPHERE:
                seen["balls"] += 1
                p, old = marker.pose.position, last["ball"]
                if old:
                    seen["moved"] += math.dist((p.x, p.y, p.z), (old.x, old.y, old.z))
                last["ball"] = p

    node.create_subscription(TFMessage, "/tf", frames, 10)
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(MarkerArray, args.topic, markers, latched)
    began = time.time()
    while not done:
        rclpy.spin_once(node, timeout_sec=0.1)
    seen["seconds"] = time.time() - began
    with open(args.json, "w") as file:
        json.dump(seen, file)


if __name__ == "__main__":
    main()
