"""An arm behind a ros2_control controller as an rclpy node: what the bridge talks to where no robot
is.

It keeps the rules that joint_trajectory_controller documents. A trajectory on its topic takes the
place of the one before it in the next cycle, as a whole: until its first point the arm goes there
from where it is and as it moves (`interpolate_from_desired_state`; joints that turn without end by the
shorter way, `angle_wraparound`), by a cubic where velocities are
given, straight where not. With `--replace stamp` it does as `allow_trajectory_replacement` does: the
old one is followed up to the stamp of the new one. A stamp of 0 means now. Refused are other joints
than its own, points out of order, a trajectory that ends in the past or not at rest. After its last
point it holds. `controller_state` tells what it does, 50 times a second, while it is active. The
action `~/follow_joint_trajectory` takes trajectories as goals: one that comes while another is under way
takes its place, and the old one ends aborted; it has succeeded once its last point is reached; cancelled,
the arm holds. The service `/controller_manager/list_controllers` tells the controller's state. The
service `/power` (std_srvs/SetBool) switches the motors, and `/running` (std_msgs/Bool) tells them.

`--interface position` is a forward_position_controller instead: what comes on `commands` is where
the joints are to be, each message a `--period` after the last: its drives take the positions at that
pace, whenever the message came. One that comes later than `LATE` after the last one in mid-motion
counts as late: the arm has stood meanwhile.

The arm follows the desired position with a lag of the first order; joint states go out at 100 Hz.
At its end the node writes what it saw as JSON: messages, those that came late, the largest steps of
the desired position and velocity, and the measured positions.

Lines on its standard input play what can go wrong: `mute` and `speak` (joint states cease and come
again), `old` (their stamps are 0.6 s old), `ahead` (0.6 s ahead), `halt`
and `run` (the motors lose their power and get it back), `idle` and `work` (the controller is
switched off, and on), `deaf` (it no longer listens), `lose N` (the next N messages are lost).
"""

import argparse
import json
import math
import os
import signal
import sys
import threading
import time

import rclpy
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from controller_manager_msgs.msg import ControllerState
from controller_manager_msgs.srv import ListControllers
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "ros"))
from arm import Arm  # noqa: E402  (its folder is named above)

CYCLE = 0.002
# Of a message of positions in mid-motion. [s]
LATE = 0.1


def between(a, b, now):
    """From one (time, positions, velocities) to another: cubic with velocities, else straight."""
    (t0, q0, v0), (t1, q1, v1) = a, b
    h = t1 - t0
    if now >= t1 or h <= 0:
        return list(q1), list(v1 or [0.0] * len(q1))
    u = max(0.0, (now - t0) / h)
    q, v = [], []
    for j in range(len(q1)):
        d = q1[j] - q0[j]
        if v1 is None:
            q.append(q0[j] + d * u)
            v.append(d / h)
            continue
        a, b = v0[j] * h, v1[j] * h
        c2, c3 = 3 * d - 2 * a - b, a + b - 2 * d
        q.append(q0[j] + u * (a + u * (c2 + u * c3)))
        v.append((a + u * (2 * c2 + 3 * u * c3)) / h)
    return q, v


class Controller(Arm):
    """What it aims at, and the arm behind it."""

    def __init__(self, names, start, turns, at_stamp, period):
        self.names, self.turns, self.at_stamp, self.period = names, turns, at_stamp, period
        self.lock = threading.Lock()
        super().__init__(start)
        self.active, self.powered, self.lose = True, True, 0
        self.number = None
        # When positions last came, and the longest time between two in mid-motion.
        self.placed, self.longest = 0.0, 0.0
        self.hold(list(start))

    def hold(self, q):
        self.points = [(0.0, q, [0.0] * len(q))]

    def works(self):
        return self.active and self.powered

    def switch(self, active=None, powered=None):
        """On again it begins where the arm is measured."""
        with self.lock:
            self.active = self.active if active is None else active
            self.powered = self.powered if powered is None else powered
            self.hold(list(self.measured))
            self.stand()

    def desired(self, now):
        """By the point before and the point after."""
        before = self.points[0]
        for point in self.points[1:]:
            if point[0] > now:
                return between(before, point, now)
            before = point
        # After its last point it holds.
        return list(before[1]), [0.0] * len(before[1])

    def wanted(self, message, now):
        """The trajectory's points in this one's order; why it is refused."""
        if sorted(message.joint_names) != sorted(self.names) or not message.points:
            return None, "other joints"
        order = [message.joint_names.index(name) for name in self.names]
        stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        start = stamp or now
        points, before = [], -1.0
        for point in message.points:
            after = point.time_from_start.sec + point.time_from_start.nanosec * 1e-9
            if after <= before or len(point.positions) != len(self.names):
                return None, "points out of order"
            before = after
            velocities = [point.velocities[i] for i in order] if len(point.velocities) else None
            points.append((start + after, [point.positions[i] for i in order], velocities))
        if any(points[-1][2] or []):
            return None, "not at rest at its end"
        if points[-1][0] < now:
            return None, "it ends in the past"
        return points, start

    def count(self, label):
        """How many messages on from the last one this one is: the bridge numbers what it sends."""
        number, before = int(label.split()[-1]), self.number
        self.seen["messages"] += 1
        self.number = number
        # Another bridge counts from 1 again.
        on = 1 if before is None or number <= before else number - before
        self.seen["lost"] += on - 1
        return on

    def take(self, message):
        now = time.time()
        with self.lock:
            self.count(message.header.frame_id)
            if self.lose > 0:
                self.lose -= 1
                return
            if not self.works():
                return
            points, start = self.wanted(message, now)
            if points is None:
                print("refused:", start, flush=True)
                self.seen["dropped"] += 1
                return
            if points[0][0] < now:
                # It has to go on in the midst of it.
                self.seen["late"] += 1
            self.follow_on(points, max(now, start) if self.at_stamp else now)

    def pursue(self, message):
        """A goal's trajectory: when it ends, `None` where it is refused."""
        now = time.time()
        with self.lock:
            self.seen["goals"] += 1
            points, start = self.wanted(message, now) if self.works() else (None, "it does not work")
            if points is None:
                print("refused:", start, flush=True)
                self.seen["dropped"] += 1
                return None
            self.follow_on(points, max(now, start) if self.at_stamp else now)
            return points[-1][0]

    def give_up(self):
        """It holds where it is to be."""
        with self.lock:
            self.hold(self.desired(time.time())[0])

    def follow_on(self, points, at):
        """These points from then on, from where it is to be then."""
        q, v = self.desired(at)
        for j, turning in enumerate(self.turns):
            if turning:
                by = 2 * math.pi * round((q[j] - points[0][1][j]) / (2 * math.pi))
                for point in points:
                    point[1][j] += by
        kept = [p for p in self.points if p[0] < at] or self.points[:1]
        self.points = kept[-200:] + [(at, q, v)] + [p for p in points if p[0] > at]

    def place(self, message):
        now = time.time()
        with self.lock:
            on = self.count(message.layout.dim[0].label)
            q = list(message.data)
            if not self.works() or len(q) != len(self.names):
                return
            # Positions alone: their velocity is what they show.
            v = [(a - b) / (on * self.period) for a, b in zip(q, self.last[0])]
            gap = now - self.placed
            self.placed = now
            if any(self.last[1]):
                self.longest = max(self.longest, gap)
                self.seen["late"] += gap > LATE
            self.judge(q, v, on * self.period)
            self.hold(q)

    def step(self, now, straight):
        """One cycle of the controller."""
        with self.lock:
            if not self.works():
                self.rest()
                return
            q, v = self.desired(now)
            if straight:
                # A position, which is set: nothing is known of a velocity.
                self.follow(q, [0.0] * len(q))
                return
            self.judge(q, v, self.elapsed)
            self.follow(q, v)


class Goals:
    """The controller's action: one goal at a time."""

    def __init__(self, node, arm, name):
        self.node, self.arm, self.lock = node, arm, threading.Lock()
        self.current, self.end, self.next = None, 0.0, None
        self.told = 0.0
        self.ends = {}
        self.server = ActionServer(
            node, FollowJointTrajectory, name + "/follow_joint_trajectory", execute_callback=self.execute,
            goal_callback=self.asked, handle_accepted_callback=self.accepted,
            cancel_callback=lambda _: CancelResponse.ACCEPT)

    def asked(self, request):
        end = self.arm.pursue(request.trajectory)
        if end is None:
            return GoalResponse.REJECT
        self.next = end
        return GoalResponse.ACCEPT

    def accepted(self, handle):
        with self.lock:
            old, self.current, self.end = self.current, handle, self.next
            self.ends[bytes(handle.goal_id.uuid)] = Future(executor=rclpy.get_global_executor())
            handle.execute()
        if old:
            self.finish(old, "abort", -6, "another goal came")

    async def execute(self, handle):
        return await self.ends[bytes(handle.goal_id.uuid)]

    def finish(self, handle, how, code, text=""):
        getattr(handle, how)()
        result = FollowJointTrajectory.Result(error_code=code, error_string=text)
        self.ends[bytes(handle.goal_id.uuid)].set_result(result)

    def step(self, now):
        with self.lock:
            handle, end = self.current, self.end
            if handle is None:
                return
            if handle.is_cancel_requested:
                self.arm.give_up()
                self.current = None
                how = ("canceled", 0)
            elif not self.arm.works():
                self.current = None
                how = ("abort", -4)
            elif now >= end + 0.05:
                self.current = None
                how = ("succeed", 0)
            else:
                if now < self.told + 0.1:
                    return
                self.told = now
                feedback = FollowJointTrajectory.Feedback(joint_names=self.arm.names)
                feedback.desired.positions, feedback.actual.positions = self.arm.last[0], self.arm.measured
                feedback.error.positions = [a - b for a, b in zip(self.arm.last[0], self.arm.measured)]
                handle.publish_feedback(feedback)
                return
        self.finish(handle, *how)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plan", required=True, help="plan file: where the joints stand at first")
    parser.add_argument("--json", required=True, help="where what was seen is written")
    parser.add_argument("--controller", default="/arm_controller")
    parser.add_argument("--interface", choices=["trajectory", "position"], default="trajectory")
    parser.add_argument("--period", type=float, default=0.002,
                        help="time between two messages of positions [s]")
    parser.add_argument("--replace", choices=["arrival", "stamp"], default="arrival")
    parser.add_argument("--wrap", action="store_true", help="tell angles within ±π")
    parser.add_argument("--rename", action="append", default=[], metavar="URDF=ROS")
    args = parser.parse_args()
    with open(args.plan) as file:
        plan = json.load(file)
    renamed = dict(pair.split("=") for pair in args.rename)
    names = [renamed.get(name, name) for name in plan["joints"]]
    start = plan["knots"][0]["q"][: len(names)]
    held = [(renamed.get(j["name"], j["name"]), j["position"]) for j in plan["held"]]
    turns = ["roll_joint" in name and "upper" not in name for name in plan["joints"]]
    arm = Controller(names, start, turns, args.replace == "stamp", args.period)
    state = {"mute": False, "age": 0.0}

    try:
        # A real controller has its time; every thread inherits it.
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
    except PermissionError:
        pass
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    node = rclpy.create_node("arm")
    states = node.create_publisher(JointState, "/joint_states", 10)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    running = node.create_publisher(Bool, "/running", latched)
    running.publish(Bool(data=True))
    aims = node.create_publisher(
        JointTrajectoryControllerState, args.controller + "/controller_state", 10)

    def power(on):
        arm.switch(powered=on)
        running.publish(Bool(data=on))

    def on_power(request, response):
        power(request.data)
        response.success = True
        return response

    node.create_service(SetBool, "/power", on_power)

    def on_list(_, response):
        state = "active" if arm.active else "inactive"
        response.controller = [
            ControllerState(name="joint_state_broadcaster", state="active", claimed_interfaces=[],
                            type="joint_state_broadcaster/JointStateBroadcaster"),
            ControllerState(name=args.controller.strip("/"), state=state, is_chainable=True,
                            claimed_interfaces=[name + "/position" for name in names],
                            type="joint_trajectory_controller/JointTrajectoryController")]
        return response

    node.create_service(ListControllers, "/controller_manager/list_controllers", on_list)
    if args.interface == "position":
        subscription = node.create_subscription(
            Float64MultiArray, args.controller + "/commands", arm.place, 10)
    else:
        subscription = node.create_subscription(
            JointTrajectory, args.controller + "/joint_trajectory", arm.take, 10)

    goals = None if args.interface == "position" else Goals(node, arm, args.controller)

    def play():
        for line in sys.stdin:
            word, *rest = line.split()
            if word in ("mute", "speak"):
                state["mute"], state["age"] = word == "mute", 0.0
            elif word in ("old", "ahead"):
                state["age"] = 0.6 if word == "old" else -0.6
            elif word in ("halt", "run"):
                power(word == "run")
            elif word in ("idle", "work"):
                arm.switch(active=word == "work")
            elif word == "deaf":
                node.destroy_subscription(subscription)
                if goals:
                    goals.server.destroy()
            elif word == "lose":
                arm.lose = int(rest[0])

    done = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: done.set())

    def spin():
        try:
            while not done.is_set():
                rclpy.spin_once(node, timeout_sec=0.1)
        except ExternalShutdownException:
            pass

    threading.Thread(target=play, daemon=True).start()
    spinner = threading.Thread(target=spin)
    spinner.start()
    print("arm: ready", flush=True)

    measured = []
    began = before = next_state = next_aim = time.time()
    while not done.is_set():
        time.sleep(CYCLE)
        now = time.time()
        arm.elapsed, before = now - before, now
        arm.step(now, args.interface == "position")
        if now >= next_aim and arm.active:
            next_aim = now + 0.02
            aim = JointTrajectoryControllerState(joint_names=names)
            aim.header.stamp.sec, aim.header.stamp.nanosec = int(now), int((now % 1) * 1e9)
            aim.reference.positions, aim.reference.velocities = arm.last
            aim.feedback.positions = list(arm.measured)
            aims.publish(aim)
            if goals:
                goals.step(now)
        if now >= next_state:
            next_state = max(now, next_state + 0.01)
            message = JointState()
            stamp = now - state["age"]
            message.header.stamp.sec = int(stamp)
            message.header.stamp.nanosec = int((stamp % 1) * 1e9)
            message.name = names + [name for name, _ in held]
            place = list(arm.measured)
            if args.wrap:
                place = [math.remainder(q, 2 * math.pi) if t else q for q, t in zip(place, turns)]
            message.position = place + [position for _, position in held]
            message.velocity = list(arm.speed) + [0.0] * len(held)
            if not state["mute"]:
                states.publish(message)
            measured.append([now - began] + list(arm.measured) + list(arm.last[0]))
    spinner.join()
    if args.interface == "position":
        print(f"longest time between two positions in mid-motion: {1e3 * arm.longest:.1f} ms", flush=True)
    with open(args.json, "w") as file:
        json.dump({"seen": arm.seen, "joints": names, "measured": measured}, file)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
