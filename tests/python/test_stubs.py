"""The stubs say what is there, and no more."""

import ast
import inspect
import pathlib
import re

import nullsweep
import nullsweep._nullsweep as built

FOLDER = pathlib.Path(nullsweep.__file__).parent
TREE = ast.parse((FOLDER / "_nullsweep.pyi").read_text())
# What every class has of its own accord.
PLAIN = set(dir(object)) | {"__module__", "__new__", "__iter__", "__next__", "__len__", "__weakref__"}


def names(nodes):
    return {n.name if not isinstance(n, ast.AnnAssign) else n.target.id for n in nodes
            if isinstance(n, (ast.FunctionDef, ast.ClassDef, ast.AnnAssign))}


def test_the_package_is_typed():
    assert (FOLDER / "py.typed").exists()


def test_stubs_name_everything_and_nothing_else():
    public = {name for name in dir(built) if not name.startswith("_")} | {"__version__"}
    assert names(TREE.body) == public
    for node in TREE.body:
        if isinstance(node, ast.ClassDef) and not issubclass(getattr(built, node.name), Exception):
            own = set(vars(getattr(built, node.name))) - PLAIN
            assert names(node.body) - PLAIN == own, node.name


def flags(planner, command):
    said, _ = planner(command, "--help")
    return {flag.replace("-", "_") for flag in re.findall(r"--([a-z][a-z-]+)", said)}


def keywords(name):
    [node] = [n for n in TREE.body if isinstance(n, ast.FunctionDef) and n.name == name]
    return {arg.arg for arg in node.args.kwonlyargs}


def test_every_setting_is_a_flag_and_every_flag_a_setting(planner):
    scan = {"up", "sensor_height", "sensor_pose", "support_height", "scale", "as_placed", "table",
            "unseen", "crop", "object", "obstacles", "regions", "demo"}
    cell = {"urdf", "arm", "package", "fit_capsules", "srdf", "posture", "tool", "torso", "held",
            "robot_name", "ipc_root", "cell"}
    shell = {"out", "json", "report", "help", "continue", "again", "scene", "quat", "offset"}
    shell |= {"stops", "arms", "jobs", "job"}
    for command in ("plan", "task", "follow"):
        own = keywords(command) - {"progress", "after", "again", "scan"}
        assert own <= flags(planner, command)
        # What the help of a flag names is a flag too: none is missed.
        [missing] = [flags(planner, command) - own - scan - cell - shell]
        assert not missing, (command, missing)


def test_everything_says_what_it_is():
    for name in ("plan", "task", "follow", "publish", "solve", "read"):
        assert inspect.getdoc(getattr(built, name)), name
    for name in ("Cell", "Arm", "Scan", "Scene", "Plan", "Executor", "Solutions"):
        assert inspect.getdoc(getattr(built, name)), name
