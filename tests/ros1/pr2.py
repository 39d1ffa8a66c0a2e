"""A stage with a rosmaster and a node that acts as a PR2's arm controller."""

import pathlib
import socket
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "ros"))

from faults import RESET, stall
from stage import Stage


class Pr2(Stage):
    CONNECTED = "controller listening"

    def __init__(self, folder, ipc, bins, side):
        with socket.socket() as s:
            s.bind(("127.0.0.1", 0))
            self.port = s.getsockname()[1]
        env = dict(ROS_MASTER_URI=f"http://127.0.0.1:{self.port}", ROS_IP="127.0.0.1",
                   ROS_LOG_DIR=str(folder / "ros"))
        super().__init__(folder, ipc, bins, side, env)

    def bridge_command(self):
        return [self.bridge, "run", "--arm", self.side]

    def start_robot(self, plan):
        self.master = self.start("rosmaster", "/usr/bin/python3", "/usr/bin/rosmaster", "--core",
                                 "-p", self.port)

        def answers():
            with socket.socket() as s:
                return s.connect_ex(("127.0.0.1", self.port)) == 0

        self.until("a master", answers)
        self.arm = self.start("arm", "/usr/bin/python3", HERE / "pr2_arm.py", "--plan", plan,
                              "--json", self.folder / "controller.json")
        self.until("the arm", lambda: "pr2_arm: ready" in self.said("arm"))


FAULTS = {
    "the master dies": (
        lambda s: s.master.kill(), "the ROS master is gone", "communication", None, []),
    "/joint_states ceases": (
        lambda s: s.play("mute"), "/joint_states is silent", "communication",
        lambda s: s.play("speak"), RESET),
    "joint states come 0.6 s late": (
        lambda s: s.play("old"), "its stamp is 0.6", "communication", lambda s: s.play("speak"), RESET),
    "the run stop is pressed": (
        lambda s: s.play("halt"), "the motors are halted", "fault",
        lambda s: s.play("run"), RESET),
    "the motors are halted by service": (
        lambda s: s.run(s.bridge, "halt"), "the motors are halted", "fault",
        lambda s: s.run(s.bridge, "reset"), RESET),
    "the controller no longer listens": (
        lambda s: s.play("deaf"), "controller does not listen", "fault", None, []),
    "the bridge stalls for 0.5 s": (
        lambda s: stall(s, 0.5), "would come too late", None, lambda s: None, RESET),
    "the bridge dies": (
        lambda s: s.bridge_process.kill(), None, "communication", None, []),
    "the executor dies": (
        lambda s: s.executor_process.kill(), "setpoints have ceased", None, None, []),
}
