"""Plans: as the command line makes them, with arrays in and out."""

import csv
import html
import io
import json
import threading
import time

import numpy as np
import pytest

import nullsweep
from conftest import SAMPLE, SETTINGS


def words(settings):
    """Keywords as flags."""
    flags = {name.replace("_", "-"): value for name, value in settings.items()}
    text = lambda v: ",".join(map(str, v)) if isinstance(v, tuple) else v
    return [f"--{name}={text(value)}" for name, value in flags.items()]


def test_a_plan_is_that_of_the_command_line_to_the_bit(plan, planner, tmp_path):
    theirs, ours = tmp_path / "theirs.json", tmp_path / "ours.json"
    said, code = planner("plan", SAMPLE / "scan.ply", "--out", theirs, "--json", tmp_path / "figures",
                         *words(SETTINGS))
    assert code == 0, said
    plan.write(ours)
    assert ours.read_bytes() == theirs.read_bytes()
    figures = json.loads((tmp_path / "figures").read_text())
    timeless = lambda f: {k: v for k, v in f.items() if not k.startswith("calc_time")}
    assert timeless(plan.figures) == timeless(figures)
    assert plan.is_verified and plan.violations == []


def test_what_was_taken_to_be_so_is_told(plan, planner, caplog):
    said, _ = planner("plan", SAMPLE / "scan.ply", "--out", "/dev/null", *words(SETTINGS))
    for note in plan.notes:
        assert f"note: {note}" in said


def test_a_plan_is_arrays(plan, cell):
    n, dof = len(plan), len(plan.joints)
    assert plan.joints == cell.arm.joints
    assert plan.times.shape == (n,) and plan.positions.shape == plan.velocities.shape == (n, dof)
    assert (np.diff(plan.times) > 0).all() and plan.times[-1] == pytest.approx(plan.duration)
    arm = cell.arm
    assert (plan.positions >= arm.lower).all() and (plan.positions <= arm.upper).all()
    assert (np.abs(plan.velocities) <= arm.velocity + 1e-9).all()
    # On the surface the pad's centre is on its line.
    on = ~np.isnan(plan.line).any(axis=1)
    assert 0.2 < on.mean() < 1.0
    centre = arm.fk(plan.positions[on], tool=True)[:, :3, 3]
    assert np.abs(centre - plan.line[on]).max() < 1e-3
    assert plan.surface.shape == (len(plan.reachable), 3) and plan.reachable.any()
    assert plan.patch.min() == -1 and plan.patch.max() > 0


def test_a_plan_file_is_read_and_written(plan, tmp_path):
    one, other = tmp_path / "one.json", tmp_path / "other.json"
    plan.write(one)
    read = nullsweep.Plan.read(one)
    read.write(other)
    assert one.read_bytes() == other.read_bytes()
    assert (read.positions == plan.positions).all() and read.is_verified
    assert "Plan(" in read._repr_html_() and read.figures == {}
    with pytest.raises(nullsweep.Error, match="verify"):
        read.report()


def test_an_array_of_points_is_what_its_file_would_be(tmp_path):
    points = np.random.default_rng(1).uniform([-0.2, -0.2, 0.0], [0.2, 0.2, 0.001], (4000, 3))
    np.save(tmp_path / "points.npy", points)
    how = dict(up=(0, 0, 1), sensor_height=0.9)
    ours = nullsweep.Scan(points, **how).scene()
    theirs = nullsweep.Scan(tmp_path / "points.npy", **how).scene()
    assert len(ours.points) > 100 and (ours.points == theirs.points).all()
    assert np.allclose(np.linalg.norm(ours.normals, axis=1), 1.0)
    # Whatever numpy makes numbers of, in any layout.
    turned = nullsweep.Scan(np.asfortranarray(points), **how).scene()
    assert (turned.points == theirs.points).all()
    with pytest.raises(TypeError, match=r"\(n, 3\)"):
        nullsweep.Scan(points[:, :2])


def test_progress_is_told_and_python_goes_on_meanwhile(scan, cell):
    told, beats, done = [], [0], threading.Event()

    def beat():
        while not done.is_set():
            beats[0] += 1
            time.sleep(0.005)

    other = threading.Thread(target=beat)
    other.start()
    began = time.monotonic()
    try:
        nullsweep.plan(scan, cell, progress=lambda *now: told.append(now), **SETTINGS)
    finally:
        took = time.monotonic() - began
        done.set()
        other.join()
    stages = {stage for stage, _, _ in told}
    assert {"scan", "verify"} <= stages, stages
    assert all(total is None or 0 <= count <= total for _, count, total in told)
    # Without the lock released it would beat at the callback's calls alone.
    assert beats[0] > 0.2 * took / 0.005 - 5, (beats, took)


def test_what_a_callback_raises_comes_out(scan, cell):
    calls = []

    def progress(*now):
        calls.append(now)
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        nullsweep.plan(scan, cell, progress=progress, **SETTINGS)
    assert len(calls) == 1


@pytest.mark.parametrize("settings, flag", [
    ({"ik_samples": 0}, "--ik-samples"),
    ({"v_max": -1.5}, "--v-max"),
    ({"cost": "money"}, "--cost"),
    ({"no_such": 1}, "--no-such"),
    ({"base": (1.5, 2.5)}, "--base"),
])
def test_wrong_usage_has_the_command_lines_words(scan, cell, planner, settings, flag):
    with pytest.raises(nullsweep.UsageError, match=flag) as raised:
        nullsweep.plan(scan, cell, **settings)
    said, code = planner("plan", SAMPLE / "scan.ply", *words(settings))
    assert code == 2 and str(raised.value).splitlines()[0] in said


def test_what_a_command_alone_has_is_refused(scan, cell):
    for word in ("out", "json", "report", "continue"):
        with pytest.raises(nullsweep.UsageError, match=word):
            nullsweep.plan(scan, cell, **{word: "x"})


def test_a_failure_has_the_command_lines_words(cell, planner, tmp_path):
    broken = tmp_path / "broken.pcd"
    broken.write_text("# .PCD v0.7\nFIELDS x y\n")
    for file in (broken, tmp_path / "nowhere.ply"):
        with pytest.raises(nullsweep.Error) as raised:
            nullsweep.plan(nullsweep.Scan(file), cell)
        said, code = planner("plan", file)
        assert code == 1 and str(raised.value) in said


def test_a_plan_goes_on_from_a_knot(plan, scan, cell):
    knot = len(plan) // 2
    more = nullsweep.plan(scan, cell, after=(plan, knot), ik_samples=12)
    assert (more.positions[0] == plan.positions[knot]).all()
    assert more.base == plan.base and len(more.surface) == len(plan.surface)


def test_a_plan_that_breaks_a_rule_is_an_error_with_the_plan(plan, scan, cell, tmp_path):
    sound = plan.verify(scan, cell)
    assert sound.is_verified and sound.figures["violations"] == []
    assert sound.figures["coverage_reachable"] == plan.figures["coverage_reachable"]
    file = tmp_path / "spoilt.json"
    plan.write(file)
    spoilt = json.loads(file.read_text())
    spoilt["knots"][len(plan) // 2]["q"][1] += 0.3
    file.write_text(json.dumps(spoilt))
    spoilt = nullsweep.Plan.read(file)
    assert not spoilt.is_verified
    with pytest.raises(nullsweep.BrokenPlanError, match="breaks") as raised:
        spoilt.verify(scan, cell)
    assert len(raised.value.violations) == len(raised.value.plan.violations) > 0
    assert not raised.value.plan.is_verified
    with pytest.raises(nullsweep.Error, match="verified"):
        nullsweep.publish(spoilt, cell)


def test_a_plan_is_exported(plan, tmp_path):
    rows = list(csv.reader(io.StringIO(plan.export())))
    assert len(rows) == len(plan) + 1
    at = rows[0].index(plan.joints[0]) if plan.joints[0] in rows[0] else 1
    found = np.array([[float(x) for x in row[at:at + len(plan.joints)]] for row in rows[1:]])
    assert np.allclose(found, plan.positions, atol=1e-6)
    for format, word in (("ros-yaml", "nsecs"), ("ros2-yaml", "nanosec"), ("json", '"points"')):
        plan.export(tmp_path / "plan", format=format)
        assert word in (tmp_path / "plan").read_text()
    with pytest.raises(nullsweep.UsageError, match="format"):
        plan.export(format="xml")
    with pytest.raises(OSError, match="nowhere"):
        plan.export(tmp_path / "nowhere/plan.csv")


def test_a_notebook_shows_it(plan, tmp_path):
    page = plan.report()
    shown = plan._repr_html_()
    assert shown.startswith("<iframe") and html.unescape(shown.split('srcdoc="')[1][:-11]) == page
    plan.report(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text() == page
    # One attribute holds it all.
    assert shown.count('"') == 6


def test_a_path_is_followed(cell, planner, tmp_path):
    rows = np.loadtxt(SAMPLE / "paths/rows.csv", delimiter=",", comments="#", skiprows=2)
    first, second = [rows[rows[:, 0] == segment, 1:] for segment in np.unique(rows[:, 0])[:2]]
    given = tmp_path / "given.csv"
    lines = [[s, *pose] for s, poses in enumerate([first, second]) for pose in poses]
    head = "segment,x,y,z,qx,qy,qz,qw"
    given.write_text("\n".join([head, *(",".join(map(repr, map(float, line))) for line in lines)]))
    plan = nullsweep.follow([first, second], cell)
    said, code = planner("follow", given, "--out", tmp_path / "plan.json")
    assert code == 0, said
    plan.write(tmp_path / "ours.json")
    assert (tmp_path / "ours.json").read_bytes() == (tmp_path / "plan.json").read_bytes()
    assert (plan.figures["segments"], plan.figures["met"]) == (2, len(lines))
    assert nullsweep.follow(np.concatenate([first, second]), cell).figures["segments"] == 1
    with pytest.raises(ValueError, match=r"poses\[0\]"):
        nullsweep.follow([[0, 0, 1, 0, 0, 0, 0]], cell)


def test_poses_are_met(cell, planner, tmp_path):
    table = np.loadtxt(SAMPLE / "poses.csv", delimiter=",", comments="#", skiprows=2)
    plan = nullsweep.task(table[:, 1:], cell)
    said, code = planner("task", SAMPLE / "poses.csv", "--out", tmp_path / "plan.json")
    assert code == 0, said
    plan.write(tmp_path / "ours.json")
    assert (tmp_path / "ours.json").read_bytes() == (tmp_path / "plan.json").read_bytes()
    assert plan.figures["met"] == len(table)
    with pytest.raises(ValueError, match=r"poses\[1\]"):
        nullsweep.task([[0, 0, 1, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0, 0]], cell)


def test_a_cell_is_named_or_there_is_none(monkeypatch):
    monkeypatch.chdir(SAMPLE)
    assert nullsweep.Cell().arm.dof == 7
    assert nullsweep.Cell("cell.toml").arm.dof == 6
    assert nullsweep.Cell("cell.toml").robot_name == "sample6"
    with pytest.raises(nullsweep.UsageError, match="urfd"):
        nullsweep.Cell(urfd="arm.urdf")
    with pytest.raises(nullsweep.Error, match="nowhere.toml"):
        nullsweep.Cell("nowhere.toml")
