from os import PathLike
from typing import Any, Callable, Iterator, Literal, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

Path = Union[str, "PathLike[str]"]
Floats = NDArray[np.float64]
Progress = Callable[[str, int, Optional[int]], Any]
Posture = Union[str, Sequence[float], NDArray[np.float64]]
Method = Literal["tsp", "curvature", "joint"]
Cost = Literal["effort", "time"]
Profile = Literal["velocity", "acceleration", "jerk"]

class Error(Exception): ...
class UsageError(Error): ...

class BrokenPlanError(Error):
    plan: Plan
    violations: list[str]

class LostError(Error): ...

class Cell:
    def __init__(
        self,
        path: Optional[Path] = None,
        *,
        robot_name: Optional[str] = None,
        ipc_root: Optional[Path] = None,
        urdf: Optional[Path] = None,
        arm: Optional[str] = None,
        package: Optional[Mapping[str, Path]] = None,
        fit_capsules: Optional[float] = None,
        srdf: Optional[Path] = None,
        posture: Optional[Mapping[str, Sequence[float]]] = None,
        tool: Optional[Path] = None,
        torso: Optional[float] = None,
        held: Optional[Mapping[str, float]] = None,
    ) -> None: ...
    @property
    def arm(self) -> Arm: ...
    @property
    def robot_name(self) -> str: ...
    @property
    def ipc_root(self) -> Optional[str]: ...

class Arm:
    @property
    def joints(self) -> list[str]: ...
    @property
    def dof(self) -> int: ...
    @property
    def lower(self) -> Floats: ...
    @property
    def upper(self) -> Floats: ...
    @property
    def velocity(self) -> Floats: ...
    @property
    def acceleration(self) -> Floats: ...
    @property
    def held(self) -> dict[str, float]: ...
    @property
    def redundancy(self) -> Optional[tuple[str, float, float]]: ...
    @property
    def is_numeric(self) -> bool: ...
    def fk(self, q: ArrayLike, *, tool: bool = False) -> Floats: ...
    def jacobian(self, q: ArrayLike) -> Floats: ...
    def ik(
        self,
        poses: ArrayLike,
        *,
        redundancy: Optional[ArrayLike] = None,
        tool: bool = False,
        within_limits: bool = True,
    ) -> Solutions: ...

class Solutions:
    @property
    def q(self) -> Floats: ...
    @property
    def row(self) -> NDArray[np.int64]: ...
    @property
    def branch(self) -> NDArray[np.uint8]: ...
    @property
    def redundancy(self) -> Floats: ...
    def __len__(self) -> int: ...

class Scan:
    def __init__(
        self,
        *scans: Union[Path, ArrayLike],
        up: Optional[Sequence[float]] = None,
        sensor_height: Optional[float] = None,
        sensor_pose: Optional[Sequence[Sequence[float]]] = None,
        support_height: Optional[float] = None,
        scale: Optional[float] = None,
        as_placed: bool = False,
        table: Optional[Sequence[float]] = None,
        unseen: Optional[Literal["avoid", "forbid", "free"]] = None,
        crop: Optional[Sequence[float]] = None,
        object: Union[None, int, str, Sequence[float]] = None,
        obstacles: Optional[Path] = None,
        regions: Optional[Path] = None,
    ) -> None: ...
    @staticmethod
    def demo(
        name: Literal["chair", "chair-seat", "bobby-car", "car-door"],
        *,
        unseen: Optional[Literal["avoid", "forbid", "free"]] = None,
    ) -> Scan: ...
    def scene(self, cell: Optional[Cell] = None, *, seed: int = 1) -> Scene: ...

class Scene:
    @property
    def points(self) -> Floats: ...
    @property
    def normals(self) -> Floats: ...
    @property
    def surroundings(self) -> Floats: ...
    @property
    def unseen(self) -> Floats: ...
    @property
    def notes(self) -> list[str]: ...

class Plan:
    @staticmethod
    def read(path: Path) -> Plan: ...
    def write(self, path: Path) -> None: ...
    @property
    def robot(self) -> str: ...
    @property
    def joints(self) -> list[str]: ...
    @property
    def base(self) -> list[float]: ...
    @property
    def held(self) -> dict[str, float]: ...
    @property
    def seed(self) -> int: ...
    @property
    def duration(self) -> float: ...
    @property
    def times(self) -> Floats: ...
    @property
    def positions(self) -> Floats: ...
    @property
    def velocities(self) -> Floats: ...
    @property
    def line(self) -> Floats: ...
    @property
    def patch(self) -> NDArray[np.int64]: ...
    @property
    def surface(self) -> Floats: ...
    @property
    def reachable(self) -> NDArray[np.bool_]: ...
    @property
    def is_verified(self) -> bool: ...
    @property
    def figures(self) -> dict[str, Any]: ...
    @property
    def violations(self) -> list[str]: ...
    @property
    def notes(self) -> list[str]: ...
    def verify(
        self,
        scan: Optional[Scan] = None,
        cell: Optional[Cell] = None,
        *,
        progress: Optional[Progress] = None,
    ) -> Plan: ...
    def export(
        self, path: Optional[Path] = None, *, format: Literal["csv", "json", "ros-yaml", "ros2-yaml"] = "csv"
    ) -> Optional[str]: ...
    def report(self, path: Optional[Path] = None) -> Optional[str]: ...
    def _repr_html_(self) -> str: ...
    def __len__(self) -> int: ...

def plan(
    scan: Scan,
    cell: Optional[Cell] = None,
    *,
    progress: Optional[Progress] = None,
    after: Optional[tuple[Plan, int]] = None,
    again: bool = False,
    base: Union[str, Sequence[float], None] = None,
    torso: Optional[float] = None,
    held: Optional[Mapping[str, float]] = None,
    start: Optional[Posture] = None,
    end: Optional[Posture] = None,
    method: Optional[Method] = None,
    cost: Optional[Cost] = None,
    ik_samples: Optional[int] = None,
    v_max: Optional[float] = None,
    profile: Optional[Profile] = None,
    jerk: Optional[str] = None,
    tool_speed: Optional[float] = None,
    smooth: Optional[Literal["auto", "on", "off"]] = None,
    patch_radius: Optional[float] = None,
    neighbours: Optional[int] = None,
    radius: Optional[float] = None,
    beta: Optional[float] = None,
    trials: Optional[int] = None,
    refinements: Optional[int] = None,
    seed: Optional[int] = None,
) -> Plan: ...
def task(
    poses: ArrayLike,
    cell: Optional[Cell] = None,
    *,
    scan: Optional[Scan] = None,
    progress: Optional[Progress] = None,
    tolerance: Union[str, Sequence[Union[float, str]], None] = None,
    stand_off: Optional[float] = None,
    floor: Optional[float] = None,
    base: Optional[Sequence[float]] = None,
    torso: Optional[float] = None,
    held: Optional[Mapping[str, float]] = None,
    start: Optional[Posture] = None,
    profile: Optional[Profile] = None,
    jerk: Optional[str] = None,
    tool_speed: Optional[float] = None,
    v_max: Optional[float] = None,
    rounds: Optional[int] = None,
    trials: Optional[int] = None,
    seed: Optional[int] = None,
) -> Plan: ...
def follow(
    path: Union[ArrayLike, Sequence[ArrayLike]],
    cell: Optional[Cell] = None,
    *,
    scan: Optional[Scan] = None,
    progress: Optional[Progress] = None,
    tolerance: Union[str, Sequence[Union[float, str]], None] = None,
    stand_off: Optional[float] = None,
    floor: Optional[float] = None,
    base: Optional[Sequence[float]] = None,
    torso: Optional[float] = None,
    held: Optional[Mapping[str, float]] = None,
    start: Optional[Posture] = None,
    profile: Optional[Profile] = None,
    jerk: Optional[str] = None,
    tool_speed: Optional[float] = None,
    v_max: Optional[float] = None,
    step: Optional[Sequence[float]] = None,
    seed: Optional[int] = None,
) -> Plan: ...
def publish(
    plan: Plan,
    cell: Optional[Cell] = None,
    *,
    join: Optional[Literal["stop", "after", "knot"]] = None,
    wait: bool = False,
    timeout: float = 5.0,
    unverified: bool = False,
    event: Optional[Callable[[str], Any]] = None,
) -> str: ...

class Executor:
    def __init__(self, cell: Optional[Cell] = None, *, timeout: float = 5.0) -> None: ...
    def __iter__(self) -> Iterator[Telemetry]: ...
    def __next__(self) -> Telemetry: ...
    @property
    def telemetry(self) -> Telemetry: ...
    def status(self) -> Status: ...
    def pause(self) -> Status: ...
    def resume(self) -> Status: ...
    def reset(self) -> Status: ...
    def speed(self, share: float) -> Status: ...
    def stop(self, *, disable: bool = False) -> Status: ...

class Status:
    mode: str
    fault: Optional[str]
    plan: Optional[str]
    knot: int
    speed: float
    is_verified: bool

class Telemetry:
    @property
    def sequence(self) -> int: ...
    @property
    def stamp(self) -> float: ...
    @property
    def mode(self) -> str: ...
    @property
    def fault(self) -> Optional[str]: ...
    @property
    def plan(self) -> Optional[str]: ...
    @property
    def plan_time(self) -> float: ...
    @property
    def knot(self) -> int: ...
    @property
    def speed(self) -> float: ...
    @property
    def commanded(self) -> Floats: ...
    @property
    def measured(self) -> Floats: ...
    @property
    def cycle(self) -> int: ...
    @property
    def missed_cycles(self) -> int: ...
    @property
    def is_verified(self) -> bool: ...

class Solution:
    clusters: list[int]
    nodes: list[int]
    cost: float
    jumps: int
    bound: Optional[float]
    proven: bool
    trials: int
    seconds: float

def solve(
    costs: ArrayLike,
    clusters: Sequence[Sequence[int]],
    *,
    seconds: Optional[float] = None,
    trials: Optional[int] = None,
    seed: int = 1,
    threads: int = 0,
    jump: Optional[float] = None,
    start: Optional[int] = None,
    bound: float = 0.0,
) -> Solution: ...
def read(path: Path) -> tuple[Floats, list[list[int]]]: ...
