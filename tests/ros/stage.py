"""Processes around a bridge: what the scenes of tests/ros1 and tests/ros2 have in common."""

import os
import pathlib
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
# A desktop stalls now and then for longer than a robot would.
PATIENT = ["--stale-ms", "100", "--lost-ms", "400"]


class Stage:
    """Processes that end with this one. Whoever derives it knows the robot's side: `start_robot`,
    `bridge_command` and what the bridge says once it is connected, `CONNECTED`."""

    CONNECTED = None

    def __init__(self, folder, ipc, bins, side, env):
        self.folder, self.side, self.all = folder, side, []
        self.planner, self.executor, self.bridge = bins
        self.place = ["--ipc-root", str(ipc)]
        folder.mkdir(parents=True, exist_ok=True)
        self.env = dict(os.environ, **env)

    def start(self, name, *command):
        log = open(self.folder / (name + ".log"), "w")
        process = subprocess.Popen([str(c) for c in command], stdin=subprocess.PIPE, stdout=log,
                                   stderr=log, env=self.env)
        self.all.append((name, process))
        return process

    def run(self, *command):
        """What a command says, and whether it ended well."""
        done = subprocess.run([str(c) for c in command], env=self.env, capture_output=True,
                              text=True)
        return done.stdout + done.stderr, done.returncode == 0

    def said(self, name):
        return (self.folder / (name + ".log")).read_text()

    def until(self, what, true, seconds=20):
        end = time.time() + seconds
        while not true():
            if time.time() > end:
                logs = "".join(f"--- {name}\n{self.said(name)}" for name, _ in self.all)
                sys.exit(f"{what} did not come true:\n{logs}")
            time.sleep(0.05)

    def start_robot(self, plan):
        """What acts as the robot, its arm standing where `plan` begins; `self.arm` writes what it
        saw to controller.json when it ends."""
        raise NotImplementedError

    def trouble(self, over):
        """What shall make no difference, until it is `over`."""

    def start_bridge(self, *options):
        self.bridge_process = self.start("bridge", *self.bridge_command(), *self.place, *options)
        self.until("the bridge", lambda: self.CONNECTED in self.said("bridge"))

    def start_executor(self):
        self.executor_process = self.start("executor", self.executor, "run", "--arm", self.side,
                                           *self.place, *PATIENT)
        self.until("hold", lambda: "holding, no plan runs" in self.status())

    def status(self):
        return self.run(self.executor, "ctl", *self.place, "status")[0].strip()

    def play(self, word):
        """Has the arm's node play a fault."""
        self.arm.stdin.write((word + "\n").encode())
        self.arm.stdin.flush()

    def end(self, process, seconds=10):
        process.send_signal(signal.SIGINT)
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def close(self):
        for _, process in reversed(self.all):
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                self.end(process, 3)


def tell(checks):
    """Prints what is so and what is not; whether all is."""
    for what, ok, figure in checks:
        print(("ok   " if ok else "FAIL ") + what + ": " + figure, flush=True)
    return all(ok for _, ok, _ in checks)


def no_jump(seen):
    """The checks that every run of the controller must pass."""
    return [
        ("no jump of the desired position", seen["step"] < 1e-3, f"{seen['step']:.6f} rad"),
        ("no jump of the desired velocity", seen["velocity_step"] < 0.02,
         f"{seen['velocity_step']:.3f} rad/s in a cycle"),
    ]
