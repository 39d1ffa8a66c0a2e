"""A redundant arm sweeps a surface that a depth camera has seen: plans, kinematics, tours, executor."""

from . import gtsp
from ._nullsweep import (
    Arm,
    BrokenPlanError,
    Cell,
    Error,
    Executor,
    LostError,
    Plan,
    Scan,
    Scene,
    Solutions,
    Status,
    Telemetry,
    UsageError,
    __version__,
    follow,
    plan,
    publish,
    task,
)

__all__ = [
    "Arm", "BrokenPlanError", "Cell", "Error", "Executor", "LostError", "Plan", "Scan", "Scene",
    "Solutions", "Status", "Telemetry", "UsageError", "__version__", "follow", "gtsp", "plan", "publish",
    "task",
]
