#!/usr/bin/python3
"""A PR2 arm's controller as a rospy node: what the bridge talks to where no PR2 is.

It does what the PR2's JointTrajectoryActionController is published to do: a new trajectory takes
effect at its stamp (10 ms from now for a stamp of 0), keeps the old segments that begin before
that moment, starts from the *desired* state there, goes on in cubic segments where velocities are
given and straight ones where not, and holds the last position at the end. An empty trajectory
holds at the measured position. Topics preempt goals. Joint states go out at 100 Hz.

The arm follows the desired position with a lag of the first order. At its end the node writes
what it saw as JSON: messages, late stamps, the largest steps of the desired position and velocity,
and the measured positions.

Lines on its standard input play what can go wrong: `mute` and `speak` (joint states cease and come
again), `old` (their stamps are 0.6 s old), `halt` and `run` (a run stop takes the motors' power and
gives it back, as the driver tells it), `deaf` (the controller no longer listens).
"""

import argparse
import json
import math
import os
import sys
import threading
import time

import genpy.dynamic
import rospy
from actionlib_msgs.msg import GoalStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Empty, EmptyResponse
from trajectory_msgs.msg import JointTrajectory

TYPES = {
    "control_msgs/FollowJointTrajectoryActionGoal": (
        "Header header\nactionlib_msgs/GoalID goal_id\nFollowJointTrajectoryGoal goal\n"
    ),
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
    "actionlib_msgs/GoalID": "time stamp\nstring id\n",
    "control_msgs/FollowJointTrajectoryGoal": (
        "trajectory_msgs/JointTrajectory trajectory\nJointTolerance[] path_tolerance\n"
        "JointTolerance[] goal_tolerance\nduration goal_time_tolerance\n"
    ),
    "trajectory_msgs/JointTrajectory": (
        "Header header\nstring[] joint_names\nJointTrajectoryPoint[] points\n"
    ),
    "trajectory_msgs/JointTrajectoryPoint": (
        "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n"
        "duration time_from_start\n"
    ),
    "control_msgs/JointTolerance": (
        "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
    ),
    "control_msgs/FollowJointTrajectoryActionResult": (
        "Header header\nactionlib_msgs/GoalStatus status\nFollowJointTrajectoryResult result\n"
    ),
    "actionlib_msgs/GoalStatus": (
        "GoalID goal_id\nuint8 status\nuint8 PENDING=0\nuint8 ACTIVE=1\nuint8 PREEMPTED=2\n"
        "uint8 SUCCEEDED=3\nuint8 ABORTED=4\nuint8 REJECTED=5\nuint8 PREEMPTING=6\n"
        "uint8 RECALLING=7\nuint8 RECALLED=8\nuint8 LOST=9\nstring text\n"
    ),
    "control_msgs/FollowJointTrajectoryResult": (
        "int32 error_code\nint32 SUCCESSFUL=0\nint32 INVALID_GOAL=-1\nint32 INVALID_JOINTS=-2\n"
        "int32 OLD_HEADER_TIMESTAMP=-3\nint32 PATH_TOLERANCE_VIOLATED=-4\n"
        "int32 GOAL_TOLERANCE_VIOLATED=-5\nstring error_string\n"
    ),
}


def message_type(name, parts):
    """The class of a message that no Debian package holds."""
    rule = "\n" + 80 * "=" + "\n"
    text = TYPES[name] + "".join(rule + "MSG: " + part + "\n" + TYPES[part] for part in parts)
    return genpy.dynamic.generate_dynamic(name, text)[name]


ActionGoal = message_type(
    "control_msgs/FollowJointTrajectoryActionGoal",
    [
        "std_msgs/Header",
        "actionlib_msgs/GoalID",
        "control_msgs/FollowJointTrajectoryGoal",
        "trajectory_msgs/JointTrajectory",
        "trajectory_msgs/JointTrajectoryPoint",
        "control_msgs/JointTolerance",
    ],
)
ActionResult = message_type(
    "control_msgs/FollowJointTrajectoryActionResult",
    [
        "std_msgs/Header",
        "actionlib_msgs/GoalStatus",
        "actionlib_msgs/GoalID",
        "control_msgs/FollowJointTrajectoryResult",
    ],
)

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "ros"))
from arm import Arm  # noqa: E402  (its folder is named above)

CYCLE = 0.002


class Segment:
    """From a start state to a point: cubic with velocities, else straight."""

    def __init__(self, start, q0, v0, end, q1, v1):
        self.start, self.end = start, end
        self.q0, self.v0, self.q1, self.v1 = q0, v0, q1, v1

    def sample(self, now):
        h = self.end - self.start
        if now > self.end or h <= 0:
            # Past the last segment the arm holds.
            return list(self.q1), [0.0] * len(self.q1)
        u = max(0.0, (now - self.start) / h)
        q, v = [], []
        for j in range(len(self.q1)):
            d = self.q1[j] - self.q0[j]
            if self.v1 is None:
                q.append(self.q0[j] + d * u)
                v.append(d / h)
                continue
            a, b = self.v0[j] * h, self.v1[j] * h
            c2, c3 = 3 * d - 2 * a - b, a + b - 2 * d
            q.append(self.q0[j] + u * (a + u * (c2 + u * c3)))
            v.append((a + u * (2 * c2 + 3 * u * c3)) / h)
        return q, v


class Controller(Arm):
    """The controller and the arm behind it."""

    def __init__(self, names, start, continuous):
        self.names, self.continuous = names, continuous
        self.lock = threading.Lock()
        super().__init__(start)
        self.seen["preempted"] = 0
        self.goal = None
        self.goal_end = 0.0
        self.halted = False
        self.mute, self.age = False, 0.0
        self.sequence = None
        self.hold()

    def halt(self, halted):
        """Motors off or on; then the controller is started again and holds where the arm is."""
        with self.lock:
            self.halted = halted
            self.hold()
            self.stand()

    def hold(self):
        q = list(self.measured)
        self.segments = [Segment(0.0, q, [0.0] * len(q), 0.0, q, [0.0] * len(q))]

    def segment_at(self, now):
        current = self.segments[0]
        for segment in self.segments:
            if segment.start <= now:
                current = segment
        return current

    def desired(self, now):
        return self.segment_at(now).sample(now)

    def take(self, message):
        """A new trajectory; when it ends, or None where it was dropped."""
        now = time.time()
        with self.lock:
            if not message.points:
                self.hold()
                return None
            if any(name not in message.joint_names for name in self.names):
                self.seen["dropped"] += 1
                return None
            order = [message.joint_names.index(name) for name in self.names]
            stamp = message.header.stamp.to_sec()
            start = now + 0.01 if stamp == 0 else stamp
            if start < now:
                self.seen["late"] += 1
            kept = [s for s in self.segments if s.start < start] or self.segments[:1]
            q, v = kept[-1].sample(start)
            first = [message.points[0].positions[i] for i in order]
            turns = [0.0] * len(q)
            for j, turning in enumerate(self.continuous):
                if turning:
                    turns[j] = 2 * math.pi * round((q[j] - first[j]) / (2 * math.pi))
            before = start
            for point in message.points:
                end = start + point.time_from_start.to_sec()
                q1 = [point.positions[i] + turns[j] for j, i in enumerate(order)]
                v1 = [point.velocities[i] for i in order] if point.velocities else None
                kept.append(Segment(before, q, v, end, q1, v1))
                before, q, v = end, q1, v1 or [0.0] * len(q1)
            self.segments = kept
            return before

    def step(self, now):
        """One cycle of the controller."""
        with self.lock:
            if self.halted:
                self.rest()
                return None
            q, v = self.desired(now)
            self.judge(q, v, self.elapsed)
            self.follow(q, v)
            # What has ended long ago is forgotten.
            while len(self.segments) > 1 and self.segments[1].start < now - 1.0:
                self.segments.pop(0)
            if self.goal and now >= self.goal_end + 0.1:
                done, self.goal = self.goal, None
                return done
            return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plan", required=True, help="plan file: where the joints stand at first")
    parser.add_argument("--json", required=True, help="where what was seen is written")
    args = parser.parse_args(rospy.myargv(sys.argv)[1:])
    with open(args.plan) as file:
        plan = json.load(file)
    names = plan["joints"]
    start = plan["knots"][0]["q"][: len(names)]
    held = [(joint["name"], joint["position"]) for joint in plan["held"]]
    arm = Controller(names, start, ["roll_joint" in n and "upper" not in n for n in names])

    try:
        # A real controller has its time; every thread inherits it.
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
    except PermissionError:
        pass
    rospy.init_node("pr2_arm", disable_signals=False)
    side = "/" + names[0][0] + "_arm_controller"
    states = rospy.Publisher("/joint_states", JointState, queue_size=10)
    halted = rospy.Publisher("/pr2_ethercat/motors_halted", Bool, queue_size=5, latch=True)
    calibrated = rospy.Publisher("/calibrated", Bool, queue_size=1, latch=True)
    results = rospy.Publisher(side + "/follow_joint_trajectory/result", ActionResult, queue_size=5)
    measured = []

    def finish(goal, status, code):
        message = ActionResult()
        message.header.stamp = rospy.Time.now()
        message.status.goal_id.id = goal
        message.status.status = status
        message.result.error_code = code
        results.publish(message)

    def on_command(message):
        arm.seen["messages"] += 1
        sequence = message.header.seq
        if arm.sequence is not None and sequence > arm.sequence + 1:
            arm.seen["lost"] += sequence - arm.sequence - 1
        arm.sequence = sequence
        if arm.goal:
            goal, arm.goal = arm.goal, None
            arm.seen["preempted"] += 1
            finish(goal, GoalStatus.PREEMPTED, 0)
        arm.take(message)

    def on_goal(message):
        arm.seen["goals"] += 1
        old = arm.goal
        end = arm.take(message.goal.trajectory)
        if end is None:
            finish(message.goal_id.id, GoalStatus.REJECTED, -2)
            return
        arm.goal, arm.goal_end = message.goal_id.id, end
        if old:
            arm.seen["preempted"] += 1
            finish(old, GoalStatus.PREEMPTED, 0)

    def set_halted(value):
        # As the driver does: what it tells on a change is the value before it; the right one
        # follows within a second.
        halted.publish(Bool(arm.halted))
        arm.halt(value)

    def service(value):
        def call(_):
            set_halted(value)
            return EmptyResponse()

        return call

    def play():
        for line in sys.stdin:
            word = line.strip()
            if word in ("mute", "speak"):
                arm.mute, arm.age = word == "mute", 0.0
            elif word == "old":
                arm.age = 0.6
            elif word in ("halt", "run"):
                set_halted(word == "halt")
            elif word == "deaf":
                commands.unregister()

    commands = rospy.Subscriber(side + "/command", JointTrajectory, on_command, queue_size=50,
                     tcp_nodelay=True)
    rospy.Subscriber(side + "/follow_joint_trajectory/goal", ActionGoal, on_goal, queue_size=5,
                     tcp_nodelay=True)
    rospy.Service("/pr2_ethercat/halt_motors", Empty, service(True))
    rospy.Service("/pr2_ethercat/reset_motors", Empty, service(False))
    calibrated.publish(Bool(True))
    halted.publish(Bool(False))
    threading.Thread(target=play, daemon=True).start()
    print("pr2_arm: ready", flush=True)

    began = before = time.time()
    next_state = next_flag = began
    while not rospy.is_shutdown():
        time.sleep(CYCLE)
        now = time.time()
        arm.elapsed, before = now - before, now
        done = arm.step(now)
        if done:
            finish(done, GoalStatus.SUCCEEDED, 0)
        if now >= next_state:
            next_state = max(now, next_state + 0.01)
            message = JointState()
            message.header.stamp = rospy.Time.from_sec(now - arm.age)
            message.name = names + [name for name, _ in held]
            message.position = list(arm.measured) + [position for _, position in held]
            message.velocity = list(arm.speed) + [0.0] * len(held)
            message.effort = [0.0] * len(message.name)
            if not arm.mute:
                states.publish(message)
            measured.append([now - began] + list(arm.measured) + list(arm.last[0]))
        if now >= next_flag:
            next_flag = now + 1.0
            halted.publish(Bool(arm.halted))
    with open(args.json, "w") as file:
        json.dump({"seen": arm.seen, "joints": names, "measured": measured}, file)


if __name__ == "__main__":
    main()
