"""What the tests share: the sample arm, its scan, a plan of it, and an executor on mock hardware."""

import os
import pathlib
import signal
import subprocess
import time

import pytest

import nullsweep

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SAMPLE = ROOT / "examples/sample"
# Quick, and enough for what is looked at.
SETTINGS = {"ik_samples": 12}


@pytest.fixture(scope="session")
def bins():
    return pathlib.Path(os.environ["NULLSWEEP_BINS"])


@pytest.fixture(scope="session")
def cell():
    return nullsweep.Cell(SAMPLE / "cell.toml")


@pytest.fixture(scope="session")
def scan():
    return nullsweep.Scan(SAMPLE / "scan.ply")


@pytest.fixture(scope="session")
def plan(scan, cell):
    return nullsweep.plan(scan, cell, **SETTINGS)


@pytest.fixture(scope="session")
def planner(bins):
    """Runs `planner` with the sample's cell; what it said and its exit code."""

    def run(*words, cell=SAMPLE / "cell.toml"):
        done = subprocess.run([str(w) for w in (bins / "planner", *words, "--cell", cell)],
                              capture_output=True, text=True)
        return done.stdout + done.stderr, done.returncode

    return run


class Stage:
    """The mock hardware where a plan begins, and the executor."""

    def __init__(self, bins, plan, folder):
        self.root = folder / "ipc"
        self.cell = nullsweep.Cell(SAMPLE / "cell.toml", ipc_root=self.root)
        file = folder / "plan.json"
        plan.write(file)
        place = ["--cell", SAMPLE / "cell.toml", "--ipc-root", self.root]
        log = open(folder / "log", "w")
        start = lambda *words: subprocess.Popen([str(w) for w in words], stdout=log, stderr=log)
        self.mock = start(bins / "mock-hardware", "--plan", file, *place)
        self.executor = start(bins / "executor", "run", *place, "--stale-ms", "100", "--lost-ms", "400")
        self.until(lambda: nullsweep.Executor(self.cell).status().mode == "hold")

    def until(self, true, seconds=30):
        end = time.monotonic() + seconds
        while True:
            try:
                if true():
                    return
            except (nullsweep.Error, TimeoutError):
                pass
            assert time.monotonic() < end, "it did not come true"
            time.sleep(0.1)

    def close(self):
        for process in (self.executor, self.mock):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                try:
                    process.wait(5)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


@pytest.fixture
def stage(bins, plan, tmp_path):
    stage = None
    try:
        stage = Stage(bins, plan, tmp_path)
        yield stage
    finally:
        if stage is not None:
            stage.close()
