"""A program like MoveIt in front of `ros2-bridge serve`: sends goals of FollowJointTrajectory, lets
some run, replaces some in mid-motion and cancels some, and writes what became of each as JSON.
"""

import argparse
import json
import os
import random
import time

import rclpy
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ENDS = {GoalStatus.STATUS_SUCCEEDED: "succeeded", GoalStatus.STATUS_CANCELED: "canceled",
        GoalStatus.STATUS_ABORTED: "aborted"}


class Program:
    def __init__(self, controller, joint):
        self.node = rclpy.create_node("program")
        self.joint, self.state, self.feedback = joint, None, 0
        self.goals = []
        self.node.create_subscription(JointState, "/joint_states", self.hear, 1)
        self.client = ActionClient(self.node, FollowJointTrajectory,
                                   controller + "/follow_joint_trajectory")
        self.everything = self.node.create_client(
            CancelGoal, controller + "/follow_joint_trajectory/_action/cancel_goal")
        self.topic = self.node.create_publisher(JointTrajectory, controller + "/joint_trajectory", 10)

    def hear(self, state):
        self.state = state

    def until(self, true, seconds=20.0):
        end = time.time() + seconds
        while not true() and time.time() < end:
            rclpy.spin_once(self.node, timeout_sec=0.01)
        return true()

    def wait(self, seconds):
        self.until(lambda: False, seconds)

    def at(self):
        return list(self.state.position)[self.joint]

    def trajectory(self, target, seconds):
        """From where the arm is measured to where one joint is elsewhere, in a curve."""
        here = list(self.state.position)
        there = list(here)
        there[self.joint] = target
        still = [0.0] * len(here)
        message = JointTrajectory(joint_names=list(self.state.name))
        for after, place in ((0.0, here), (seconds, there)):
            point = JointTrajectoryPoint(positions=place, velocities=still)
            point.time_from_start.sec = int(after)
            point.time_from_start.nanosec = int(after % 1 * 1e9)
            message.points.append(point)
        # Any order of the joints will do.
        order = random.sample(range(len(here)), len(here))
        message.joint_names = [message.joint_names[i] for i in order]
        for point in message.points:
            point.positions = [point.positions[i] for i in order]
            point.velocities = [point.velocities[i] for i in order]
        return message

    def send(self, kind, target, seconds=1.0, wait=True):
        goal = {"kind": kind, "accepted": None, "ends": [], "target": target}
        self.goals.append(goal)

        def told(_):
            self.feedback += 1

        def ended(future):
            result = future.result()
            goal["ends"].append(ENDS.get(result.status, str(result.status)))
            goal["code"], goal["text"] = result.result.error_code, result.result.error_string
            goal["short"] = abs(target - self.at())

        def answered(future):
            goal["handle"] = future.result()
            goal["accepted"] = goal["handle"].accepted
            if goal["accepted"]:
                goal["handle"].get_result_async().add_done_callback(ended)

        request = FollowJointTrajectory.Goal(trajectory=self.trajectory(target, seconds))
        self.client.send_goal_async(request, feedback_callback=told).add_done_callback(answered)
        if wait:
            self.until(lambda: goal["accepted"] is not None)
        return goal

    def cancel_all(self):
        """No more of anything."""
        future = self.everything.call_async(CancelGoal.Request())
        self.until(future.done)

    def rests(self, seconds=0.3):
        """Whether the arm stands for so long, once it does."""
        self.wait(seconds)
        before = self.at()
        self.wait(seconds)
        return abs(self.at() - before) < 1e-4


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--controller", default="/nullsweep")
    parser.add_argument("--joint", type=int, default=5, help="which joint moves, from 0")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--json", required=True)
    parser.add_argument("--last", action="store_true", help="leave a goal under way at the end")
    args = parser.parse_args()
    random.seed(1)
    try:
        # Else it hears of a goal when that is over, on a machine with much else to do.
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    except PermissionError:
        pass
    rclpy.init()
    program = Program(args.controller, args.joint)
    if not program.client.wait_for_server(timeout_sec=60.0):
        raise SystemExit("no action server came")
    if not program.until(lambda: program.state is not None):
        raise SystemExit("no joint states came")
    print("goals: begun", flush=True)
    home = program.at()
    began = time.time()
    for number in range(args.count):
        kind = random.choice(["run", "replace", "replace", "replace", "cancel", "cancel"])
        target = home + 0.06 * (1 if number % 2 else -1) * random.uniform(0.5, 1.0)
        goal = program.send(kind, target)
        if not goal["accepted"]:
            program.wait(0.2)
        elif kind == "run":
            program.until(lambda: goal["ends"])
        else:
            # It moves for a second from then on, and longer where it is far.
            program.wait(random.uniform(0.02, 0.6))
            if kind == "cancel":
                goal["handle"].cancel_goal_async()
                program.until(lambda: goal["ends"])
    program.until(lambda: all(g["ends"] or not g["accepted"] for g in program.goals))
    # No more of anything, while a second goal waits that the first one stops: neither goes on.
    first = program.send("swept off", home + 0.06, 3.0)
    program.wait(0.5)
    second = program.send("swept off", home - 0.06, 3.0, wait=False)
    program.wait(0.05)
    program.cancel_all()
    program.until(lambda: first["ends"] and second["accepted"] is not None, 5.0)
    swept = program.rests() and second["accepted"] is not None
    # A trajectory on the topic has no goal that could be named.
    program.topic.publish(program.trajectory(home + 0.05, 3.0))
    program.wait(0.8)
    program.cancel_all()
    swept = swept and program.rests(0.5) and abs(program.at() - home - 0.05) > 0.005
    # One that is to begin later waits until then.
    late = program.trajectory(home, 0.6)
    stamp = time.time() + 2.0
    late.header.stamp.sec, late.header.stamp.nanosec = int(stamp), int(stamp % 1 * 1e9)
    here = program.at()
    program.topic.publish(late)
    program.wait(1.6)
    later = abs(program.at() - here) < 1e-3
    later = program.until(lambda: abs(program.at() - home) < 0.005, 10.0) and later
    # What came on the topic has no goal, and moves the arm all the same.
    program.topic.publish(program.trajectory(home + 0.05, 0.6))
    reached = program.until(lambda: abs(program.at() - home - 0.05) < 0.005, 10.0)
    # A result that is asked for again is the same one.
    asked_again = program.goals[-1]["handle"].get_result_async() if program.goals[-1]["accepted"] else None
    same = asked_again is None or (program.until(asked_again.done) and
                                   ENDS.get(asked_again.result().status) == program.goals[-1]["ends"][0])
    program.wait(1.0)
    if args.last:
        # In the midst of it the bridge is ended by whoever called this.
        program.send("ended", home - 0.06, 4.0)
        program.wait(0.5)
        print("goals: moving", flush=True)
        program.wait(8.0)
    goals = [{k: v for k, v in g.items() if k != "handle"} for g in program.goals]
    with open(args.json, "w") as file:
        json.dump({"goals": goals, "feedback": program.feedback, "topic": reached, "same": same,
                   "swept": swept, "later": later,
                   "seconds": time.time() - began}, file)
    program.node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
