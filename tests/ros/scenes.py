"""What is played on a stage: a whole sweep with a swap, and the rules of an endpoint."""

import argparse
import json
import os
import pathlib
import subprocess
import threading
import time

from stage import ROOT, no_jump, tell

# Where the robot stands before the chair for each arm.
BASE = {"right": "-0.708,-0.004,1.047", "left": "-0.708,0.004,-1.047"}
# For a desktop, as stage.PATIENT.
STREAM = ["--delay", "100", "--timeout", "100"]
# The bridge's arm comes to rest later than the mock's, and its motors are on later.
RULES = ["--grace", "1000", "--power", "3000"]


def arguments(about):
    """The switches that all scenes have, and the group of those that choose one."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--faults", action="store_true",
                      help="loss of topics, of processes; halts; late messages")
    mode.add_argument("--conformance", action="store_true",
                      help="does the bridge, as it runs by default, keep every rule of an endpoint?")
    parser.add_argument("--arm", choices=["right", "left"], default="right")
    parser.add_argument("--keep", type=pathlib.Path, help="keep plans, logs and figures here")
    parser.add_argument("--v-max", default="0.5", help="velocity of the fastest joint [rad/s]")
    parser.add_argument("--bridge", help="use this bridge")
    parser.add_argument("--no-build", action="store_true", help="use what was built before")
    return parser, mode


def build(args, name):
    """Planner, executor and bridge, built unless they are not to be."""
    root = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
    own = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / name / "target")) / "release"
    bridge = pathlib.Path(args.bridge or own / name)
    if not args.no_build:
        subprocess.check_call(["cargo", "build", "--release", "-p", "nullsweep-planner", "-p",
                               "nullsweep-cli", "-p", "nullsweep-executor", "-p",
                               "nullsweep-tests"], cwd=ROOT)
        if not args.bridge:
            subprocess.check_call(["cargo", "build", "--release"], cwd=ROOT / name)
    return root / "planner", root / "executor", bridge


def plans(planner, folder, args):
    """A plan, another one that takes over in a knot, and when that is."""
    common = ["plan", "--demo", "chair-seat", "--arm", args.arm, "--base=" + BASE[args.arm],
              "--torso", "0.2", "--ik-samples", "20", "--v-max", args.v_max,
              "--profile", "acceleration"]
    first, second = folder / "first.json", folder / "second.json"
    run = lambda more: subprocess.check_call([planner] + common + more, stdout=subprocess.DEVNULL)
    run(["--out", str(first), "--json", str(folder / "first-figures.json")])
    if args.faults or args.conformance or getattr(args, "serve", False) or getattr(args, "look", False):
        return first, None, None, None
    knots = json.load(open(first))["knots"]
    due = 0.35 * knots[-1]["t"]
    knot = next(k for k, value in enumerate(knots) if value["t"] >= due)
    run(["--cost", "effort", "--continue", f"{first}@{knot}", "--out", str(second),
         "--json", str(folder / "second-figures.json")])
    return first, second, knot, knots[knot]["t"] * 1e-9


def sweep(stage, first, second, knot, at, options, with_executor=True, more=()):
    """The first plan, and the second one in its place in full motion."""
    over = threading.Event()
    trouble = threading.Thread(target=stage.trouble, args=(over,))
    try:
        stage.start_robot(first)
        stage.start_bridge(*options)
        if with_executor:
            stage.start_executor()
        print(f"sweeping; the second plan takes over in knot {knot}, {at:.1f} s from now", flush=True)
        trouble.start()
        said, _ = stage.run(stage.planner, "publish", first, *stage.place)
        print(said, end="")
        time.sleep(0.4 * at)
        said, ended = stage.run(stage.planner, "publish", second, *stage.place, "--wait")
        print(said, end="")
        over.set()
        trouble.join()
        time.sleep(1.0)
        stage.end(stage.arm)
    finally:
        over.set()
        stage.close()
    return judge(stage, second, ended, said, more)


def conform(stage, first, side, *options):
    """Whether the bridge keeps every rule of an endpoint."""
    try:
        stage.start_robot(first)
        stage.start_bridge(*options)
        said, kept = stage.run(stage.executor.with_name("conformance"), *stage.place, "--arm",
                               side, "--torso", "0.2", "--dare", *RULES)
        print(said, end="")
        stage.end(stage.arm)
    finally:
        stage.close()
    seen = json.load(open(stage.folder / "controller.json"))["seen"]
    # The trial itself goes round corners of velocity.
    return tell([("the bridge keeps every rule", kept, "as above"), no_jump(seen)[0],
                 ("no message late or dropped", seen["late"] + seen["dropped"] == 0,
                  f"{seen['messages']} messages")])


def judge(stage, second, ended, said, more):
    data = json.load(open(stage.folder / "controller.json"))
    seen, dof = data["seen"], len(data["joints"])
    end = json.load(open(second))["knots"][-1]["q"][:dof]
    errors = sorted(max(abs(m[1 + j] - m[1 + dof + j]) for j in range(dof))
                    for m in data["measured"])
    p95 = errors[int(0.95 * (len(errors) - 1))]
    last = max(abs(a - b) for a, b in zip(data["measured"][-1][1:1 + dof], end))
    log = stage.folder / "executor.log"
    for line in log.read_text().splitlines() if log.exists() else []:
        if "deadlines missed" in line:
            print("executor: " + line.split("INFO")[-1].split(";")[0].strip())
    return tell([
        ("the second plan ran to its end", ended, (said.splitlines() or [""])[-1]),
        ("the arm stands where it ends", last < 5e-3, f"{last:.5f} rad off"),
        ("no message lost, dropped or late", seen["lost"] + seen["dropped"] + seen["late"] == 0,
         f"{seen['messages']} messages, {seen['goals']} goals: {seen['lost']} lost, "
         f"{seen['dropped']} dropped, {seen['late']} late"),
        *no_jump(seen),
        ("the arm follows", p95 < 0.02, f"p95 {p95:.5f} rad"),
        *more,
    ])
