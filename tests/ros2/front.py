"""A stage with the executor behind `ros2-bridge serve`, on the mock hardware, and a program that
sends it goals."""

import collections
import json
import random
import signal
import struct
import subprocess
import time

from jtc import HERE
from stage import Stage, tell


class Front(Stage):
    def __init__(self, folder, ipc, bins, side, python):
        self.python = python
        env = dict(ROS_DOMAIN_ID=str(random.randrange(1, 100)),
                   ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST", ROS_LOG_DIR=str(folder / "ros"))
        super().__init__(folder, ipc, bins, side, env)

    def perform(self, plan, count):
        """Sends goals to an arm that stands where `plan` begins; whether each had its one end."""
        held = json.load(open(plan))["held"]
        held = [word for h in held for word in ("--held", f"{h['name']}={h['position']}")]
        figures = self.folder / "goals.json"
        try:
            mock = self.start("mock", self.executor.with_name("mock-hardware"), "--plan", plan,
                              "--arm", self.side, *self.place)
            self.start_executor()
            serve = self.start("serve", self.bridge, "serve", "--arm", self.side, "--publish-joint-states",
                       *held, *self.place)
            program = self.start("goals", self.python, HERE / "goals.py", "--count", count, "--json",
                                 figures, "--last")
            self.until("all goals", lambda: program.poll() is not None
                       or "goals: moving" in self.said("goals"), 60 + 5 * count)
            before = self.status()
            serve.send_signal(signal.SIGTERM)
            serve.wait(10)
            ended = ("executing" in before, self.status())
            program.wait(30)
            self.end(mock)
            quiet = mock.returncode == 0
        except subprocess.TimeoutExpired:
            quiet = False
            ended = (False, "")
        finally:
            self.close()
        if not figures.exists():
            print(self.said("goals")[-2000:], self.said("serve")[-2000:])
            return False
        return judge(json.load(open(figures)), quiet, *ended)

    def look(self, plan):
        """What RViz sees of an arm that follows `plan`, and a scan of what a camera sees."""
        held = json.load(open(plan))["held"]
        held = [word for h in held for word in ("--held", f"{h['name']}={h['position']}")]
        looked, scan = self.folder / "look.json", self.folder / "scan.pcd"
        try:
            mock = self.start("mock", self.executor.with_name("mock-hardware"), "--plan", plan, "--arm",
                              self.side, *self.place)
            self.start_executor()
            self.start("show", self.bridge, "show", plan, "--arm", self.side, "--publish-tf", *held,
                       *self.place)
            look = self.start("look", self.python, HERE / "look.py", "--json", looked)
            said, sent = self.run(self.planner, "publish", plan, *self.place)
            time.sleep(15.0)
            self.end(look)
            self.run(self.executor, "ctl", *self.place, "stop")
            self.end(mock)
            self.start("camera", self.python, HERE / "cloud.py")
            wrote, made = self.run(self.bridge, "scan", "--frame", "map", "--out", scan, "--timeout", "30")
            lost, told = self.run(self.bridge, "scan", "--frame", "nowhere", "--out", scan, "--timeout", "3")
        finally:
            self.close()
        head, _, body = scan.read_bytes().partition(b"DATA binary\n") if made else (b"", b"", b"")
        point = struct.unpack("<fff", body[:12]) if body else None
        seen = json.load(open(looked)) if looked.exists() else None
        return tell([
            ("the plan was sent", sent, said.splitlines()[-1]),
            *shown(seen),
            ("the endpoint saw no violation", mock.returncode == 0, "by the mock's judge"),
            ("a cloud became a scan, without what is no number", made and len(body) == 12 * 3599
             and abs(point[2] - 0.7) < 1e-6, wrote.strip()),
            ("it has the sensor's pose by TF", b"VIEWPOINT 0.3 0 1.2 0 1 0 0\n" in head
             and "--sensor-pose 0.3,0,1.2,1,0,0,0" in wrote, ""),
            ("a frame that is not there is told", not told and "camera_optical in map" in lost,
             lost.strip()[-120:]),
        ])


def shown(seen):
    """Whether RViz has something to show."""
    if seen is None:
        return [("frames and markers are shown", False, "nothing was seen")]
    rate = seen["messages"] / seen["seconds"]
    return [
        ("the arm's frames come, from the root", rate > 10 and seen["unit"] and len(seen["frames"]) >= 7
         and seen["root"] == "base_footprint", f"{len(seen['frames'])} frames, {rate:.0f} a second"),
        ("a plan's way is shown, on the surface and off it", seen["points"] > 50 and seen["colours"] == 2,
         f"{seen['points']} points"),
        ("the tool's place moves with the arm", seen["moved"] > 0.2, f"{seen['moved']:.2f} m"),
    ]


def judge(found, quiet, moved, status):
    goals = found["goals"]
    taken = [g for g in goals if g["accepted"]]
    ends = collections.Counter((g["kind"], *g["ends"]) for g in taken)
    words = ", ".join(f"{' '.join(key)} {n}" for key, n in sorted(ends.items()))
    one = all(len(g["ends"]) == 1 for g in taken)
    ran = [g for g in taken if g["kind"] == "run"]
    # One that is cancelled or replaced at its very end has succeeded.
    early = [g for g in taken if g["kind"] in ("cancel", "replace")]
    short = [g for g in early if g["short"] > 0.01]
    ends_as = {"cancel": "canceled", "replace": "aborted"}
    return tell([
        ("every goal was answered", all(g["accepted"] is not None for g in goals),
         f"{len(goals)} goals, {len(taken)} accepted, in {found['seconds']:.0f} s"),
        ("nearly every goal was accepted", len(taken) >= 0.98 * len(goals),
         f"{len(goals) - len(taken)} refused"),
        ("each accepted one had exactly one end", one, words),
        ("what was left alone succeeded", all(g["ends"] == ["succeeded"] for g in ran), f"{len(ran)}"),
        ("what was cancelled ended canceled, what was replaced aborted, short of where it went",
         all(g["ends"] == [ends_as[g["kind"]]] for g in short),
         f"{len(short)} of {len(early)}"),
        ("most of those were in mid-motion", len(short) >= 0.5 * len(goals),
         f"{len(short)} of {len(goals)} goals"),
        ("all cancelled: neither what runs nor what waits goes on", found["swept"], ""),
        ("what is to begin later waits", found["later"], ""),
        ("SIGTERM to the bridge stops the arm", moved and "holding, no plan runs" in status, status),
        ("a result asked for again is the same", found["same"], ""),
        ("a trajectory on the topic moves the arm", found["topic"], ""),
        ("feedback came", found["feedback"] > len(taken), f"{found['feedback']} messages"),
        ("the endpoint saw no violation", quiet, "by the mock's judge"),
    ])
