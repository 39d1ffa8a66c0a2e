"""A stage with a node that acts as an arm behind ros2_control."""

import pathlib
import random
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "ros"))

from faults import RESET, stall
from stage import Stage

CONTROLLER = "/arm_controller"
# What ROS calls some of the joints otherwise: names are mapped.
RENAME = ["--rename", "r_elbow_flex_joint=elbow", "--rename", "l_elbow_flex_joint=other_elbow"]


class Jtc(Stage):
    CONNECTED = "controller listening"

    def __init__(self, folder, ipc, bins, side, python, robot=(), bridge=(), overlaps=True):
        self.python, self.robot, self.more, self.overlaps = python, robot, bridge, overlaps
        # A domain of its own: others may be at work on this machine.
        self.domain = random.randrange(1, 100)
        env = dict(ROS_DOMAIN_ID=str(self.domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
                   ROS_LOG_DIR=str(folder / "ros"))
        super().__init__(folder, ipc, bins, side, env)

    def bridge_command(self):
        return [self.bridge, "run", "--arm", self.side, "--controller", CONTROLLER, "--running",
                "/running", "--power", "/power", *RENAME, *self.more]

    def start_robot(self, plan):
        self.arm = self.start("arm", self.python, HERE / "jtc_arm.py", "--plan", plan, "--json",
                              self.folder / "controller.json", "--controller", CONTROLLER, *RENAME,
                              *self.robot)
        self.until("the arm", lambda: "arm: ready" in self.said("arm"), 60)

    def trouble(self, over):
        """Others in the same domain and in another one who talk much, and each second a message
        that is lost, where the next one makes up for it."""
        for name, domain in (("near", self.domain), ("far", self.domain + 1)):
            self.start("noise-" + name, "env", f"ROS_DOMAIN_ID={domain}", self.python,
                       HERE / "noise.py", *([] if name == "near" else ["--with-arm"]))
        while not over.wait(1.0):
            if self.overlaps:
                self.play("lose 1")


FAULTS = {
    "the robot's node is killed": (
        lambda s: s.arm.kill(), "/joint_states is silent", "communication", None, []),
    "/joint_states ceases": (
        lambda s: s.play("mute"), "/joint_states is silent", "communication",
        lambda s: s.play("speak"), RESET),
    "joint states come 0.6 s late": (
        lambda s: s.play("old"), "its stamp is 0.6", "communication", lambda s: s.play("speak"), RESET),
    "the robot's clock is 0.6 s ahead": (
        lambda s: s.play("ahead"), "s ahead", "communication", lambda s: s.play("speak"), RESET),
    "the motors lose their power": (
        lambda s: s.play("halt"), "the motors are off", "fault", lambda s: s.play("run"), RESET),
    "the controller is switched off": (
        lambda s: s.play("idle"), "says that arm_controller is inactive", "communication", lambda s: s.play("work"), RESET),
    "the controller no longer listens": (
        lambda s: s.play("deaf"), "no controller listens", "communication", None, []),
    "the bridge stalls for 0.5 s": (
        lambda s: stall(s, 0.5), "would come too late", None, lambda s: None, RESET),
    "the bridge dies": (
        lambda s: s.bridge_process.kill(), None, "communication", None, []),
    "the executor dies": (
        lambda s: s.executor_process.kill(), "setpoints have ceased", None, None, []),
}

# A controller of bare positions tells no state, and stops at once when nothing comes any more.
BY_TRAJECTORY = ["the controller is switched off", "the bridge dies"]
