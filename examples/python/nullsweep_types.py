"""What crosses a process boundary in Nullsweep, as ctypes structures.

Generated from the Rust types, do not edit:
cargo run -p nullsweep-ipc-types --example ctypes > examples/python/nullsweep_types.py
"""

import ctypes
import enum

MAX_JOINTS = 16
MAX_HELD_JOINTS = 32
MAX_KNOTS = 16384
MAX_NODES = 20
NO_PATCH = 4294967295

_TEXTS = {}

# Bits of JointStates.status.
CALIBRATED = 1
HALTED = 2
SETPOINT_TIMEOUT = 4
ERROR = 8

# name: publishers, subscribers, buffer, history, borrowed, overflow.
SERVICES = {
    "plan": (4, 1, 4, 0, 2, False),
    "setpoint": (1, 1, 64, 0, 2, True),
    "state": (1, 1, 64, 0, 2, True),
    "telemetry": (1, 8, 64, 1, 2, True),
    "plan_event": (1, 8, 64, 16, 2, True),
}


class Interpolation(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    LINEAR = 0
    CUBIC = 1


class JoinRule(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    STOP_THEN_START = 0
    AFTER_CURRENT = 1
    AT_KNOT = 2


class Contact(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    CONTACT = 0
    TRANSFER = 1


_TEXTS[Interpolation] = {
    Interpolation.LINEAR: "linear",
    Interpolation.CUBIC: "cubic",
}
_TEXTS[JoinRule] = {
    JoinRule.STOP_THEN_START: "stop",
    JoinRule.AFTER_CURRENT: "after",
    JoinRule.AT_KNOT: "knot",
}
_TEXTS[Contact] = {
    Contact.CONTACT: "contact",
    Contact.TRANSFER: "transfer",
}


class PlanId(ctypes.Structure):
    _fields_ = [
        ("epoch", ctypes.c_uint64),
        ("number", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.PlanId.v1"


assert ctypes.sizeof(PlanId) == 16


class Knot(ctypes.Structure):
    _fields_ = [
        ("time_from_start_ns", ctypes.c_uint64),
        ("positions", ctypes.c_double * MAX_JOINTS),
        ("velocities", ctypes.c_double * MAX_JOINTS),
        ("patch", ctypes.c_uint32),
        ("contact", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.Knot.v1"


assert ctypes.sizeof(Knot) == 272


class PlanHeader(ctypes.Structure):
    _fields_ = [
        ("id", PlanId),
        ("join_plan", PlanId),
        ("fingerprint", ctypes.c_uint64),
        ("checksum", ctypes.c_uint64),
        ("tool", ctypes.c_uint64),
        ("base_pose", ctypes.c_double * 7),
        ("held_positions", ctypes.c_double * 32),
        ("held_count", ctypes.c_uint32),
        ("joint_count", ctypes.c_uint32),
        ("knot_count", ctypes.c_uint32),
        ("interpolation", ctypes.c_uint32),
        ("join_rule", ctypes.c_uint32),
        ("join_knot", ctypes.c_uint32),
        ("corners", ctypes.c_uint32),
        ("verified", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.PlanHeader.v3"


assert ctypes.sizeof(PlanHeader) == 400


class Setpoint(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("deadline_ns", ctypes.c_uint64),
        ("plan", PlanId),
        ("positions", ctypes.c_double * MAX_JOINTS),
        ("velocities", ctypes.c_double * MAX_JOINTS),
        ("joint_count", ctypes.c_uint32),
        ("mode", ctypes.c_uint32),
        ("knot", ctypes.c_uint32),
        ("disable", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.Setpoint.v1"


assert ctypes.sizeof(Setpoint) == 312


class JointStates(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("setpoint_sequence", ctypes.c_uint64),
        ("setpoint_received_ns", ctypes.c_uint64),
        ("positions", ctypes.c_double * MAX_JOINTS),
        ("velocities", ctypes.c_double * MAX_JOINTS),
        ("efforts", ctypes.c_double * MAX_JOINTS),
        ("held_positions", ctypes.c_double * 32),
        ("held_count", ctypes.c_uint32),
        ("joint_count", ctypes.c_uint32),
        ("status", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.JointStates.v1"


assert ctypes.sizeof(JointStates) == 688


class Mode(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    INIT = 0
    HOLD = 1
    EXECUTING = 2
    PAUSED = 3
    STOPPING = 4
    FAULT = 5


class Fault(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    NONE = 0
    STALE_STATE = 1
    COMMUNICATION_LOST = 2
    HALTED = 3
    NOT_CALIBRATED = 4
    ENDPOINT = 5
    FOLLOWING_ERROR = 6
    SOFT_LIMIT = 7
    STEP = 8
    NOT_FINITE = 9
    LOW_RATE = 10
    JOINT_COUNT = 11
    HELD_JOINT = 13
    ANSWER = 14
    CLOCK = 15


_TEXTS[Mode] = {
    Mode.INIT: "init",
    Mode.HOLD: "hold",
    Mode.EXECUTING: "executing",
    Mode.PAUSED: "paused",
    Mode.STOPPING: "stopping",
    Mode.FAULT: "fault",
}
_TEXTS[Fault] = {
    Fault.NONE: "none",
    Fault.STALE_STATE: "joint state is stale",
    Fault.COMMUNICATION_LOST: "communication with the hardware endpoint was lost",
    Fault.HALTED: "the hardware endpoint halted",
    Fault.NOT_CALIBRATED: "the hardware endpoint is not calibrated",
    Fault.ENDPOINT: "the hardware endpoint reports an error",
    Fault.FOLLOWING_ERROR: "following error",
    Fault.SOFT_LIMIT: "soft limit",
    Fault.STEP: "setpoint step above the velocity limit",
    Fault.NOT_FINITE: "a joint value is not finite",
    Fault.LOW_RATE: "the loop's mean rate is too low",
    Fault.JOINT_COUNT: "the joint state has another number of joints",
    Fault.HELD_JOINT: "a held joint has moved",
    Fault.ANSWER: "the hardware endpoint does not say which setpoint it follows",
    Fault.CLOCK: "the joint state is not stamped by CLOCK_MONOTONIC",
}


class Telemetry(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("cycle", ctypes.c_uint64),
        ("missed_cycles", ctypes.c_uint64),
        ("lost_lines", ctypes.c_uint64),
        ("plan", PlanId),
        ("plan_time_ns", ctypes.c_uint64),
        ("speed_scale", ctypes.c_double),
        ("commanded", ctypes.c_double * MAX_JOINTS),
        ("measured", ctypes.c_double * MAX_JOINTS),
        ("lateness", ctypes.c_uint32 * 32),
        ("compute", ctypes.c_uint32 * 32),
        ("round_trip", ctypes.c_uint32 * 32),
        ("joint_count", ctypes.c_uint32),
        ("mode", ctypes.c_uint32),
        ("fault", ctypes.c_uint32),
        ("knot", ctypes.c_uint32),
        ("unverified", ctypes.c_uint32),
        ("stopped", ctypes.c_uint32),
        ("held_count", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("held_positions", ctypes.c_double * 32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.Telemetry.v5"


assert ctypes.sizeof(Telemetry) == 1000


class EventKind(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    ACCEPTED = 0
    REJECTED = 1
    STARTED = 2
    FINISHED = 3
    SUPERSEDED = 4
    ABORTED = 5


class Reason(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    NONE = 0
    MALFORMED = 1
    CHECKSUM = 2
    ROBOT = 3
    HELD_JOINT = 4
    NOT_FINITE = 5
    TIME_ORDER = 6
    SOFT_LIMIT = 7
    VELOCITY = 8
    START = 9
    JOIN_PLAN = 10
    JOIN_KNOT = 11
    NOT_READY = 12
    QUEUE_FULL = 13
    EPOCH = 14
    STOPPED = 15
    FAULT = 16
    SHUTDOWN = 17
    ACCELERATION = 19
    REPEATED = 20
    GOAL = 21
    CORNER = 22
    JERK = 23
    SPEED = 24


_TEXTS[EventKind] = {
    EventKind.ACCEPTED: "accepted",
    EventKind.REJECTED: "rejected",
    EventKind.STARTED: "started",
    EventKind.FINISHED: "finished",
    EventKind.SUPERSEDED: "superseded",
    EventKind.ABORTED: "aborted",
}
_TEXTS[Reason] = {
    Reason.NONE: "none",
    Reason.MALFORMED: "malformed message",
    Reason.CHECKSUM: "checksum mismatch",
    Reason.ROBOT: "made for another robot",
    Reason.HELD_JOINT: "a held joint stands elsewhere",
    Reason.NOT_FINITE: "a value is not finite",
    Reason.TIME_ORDER: "knot times do not rise",
    Reason.SOFT_LIMIT: "outside the soft limits",
    Reason.VELOCITY: "above the velocity limit",
    Reason.START: "does not start where the arm is",
    Reason.JOIN_PLAN: "the plan to join is not running",
    Reason.JOIN_KNOT: "the knot to join has passed",
    Reason.NOT_READY: "the executor is not ready",
    Reason.QUEUE_FULL: "too many plans are waiting",
    Reason.EPOCH: "published before the executor started",
    Reason.STOPPED: "stopped by command",
    Reason.FAULT: "ended by a fault",
    Reason.SHUTDOWN: "the executor shut down",
    Reason.ACCELERATION: "above the acceleration limit",
    Reason.REPEATED: "a plan of this id came before",
    Reason.GOAL: "the arm did not come to rest at the plan's end",
    Reason.CORNER: "a corner that the plan does not ask for",
    Reason.JERK: "above the jerk limit",
    Reason.SPEED: "begins in motion, not at the arm's velocity",
}


class PlanEvent(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("plan", PlanId),
        ("value", ctypes.c_double),
        ("bound", ctypes.c_double),
        ("kind", ctypes.c_uint32),
        ("reason", ctypes.c_uint32),
        ("joint", ctypes.c_uint32),
        ("knot", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.PlanEvent.v1"


assert ctypes.sizeof(PlanEvent) == 64


class CommandKind(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    STATUS = 0
    PAUSE = 1
    RESUME = 2
    STOP = 3
    STOP_AND_DISABLE = 4
    SPEED = 5
    RESET = 6


class Verdict(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    ACCEPTED = 0
    WRONG_MODE = 1
    BAD_VALUE = 2
    UNKNOWN = 3
    STILL_FAULTY = 4
    BUSY = 5


_TEXTS[CommandKind] = {
    CommandKind.STATUS: "status",
    CommandKind.PAUSE: "pause",
    CommandKind.RESUME: "resume",
    CommandKind.STOP: "stop",
    CommandKind.STOP_AND_DISABLE: "stop and disable",
    CommandKind.SPEED: "speed",
    CommandKind.RESET: "reset",
}
_TEXTS[Verdict] = {
    Verdict.ACCEPTED: "accepted",
    Verdict.WRONG_MODE: "not possible in this mode",
    Verdict.BAD_VALUE: "the value is out of range",
    Verdict.UNKNOWN: "unknown command",
    Verdict.STILL_FAULTY: "the cause of the fault is still there",
    Verdict.BUSY: "busy",
}


class Command(ctypes.Structure):
    _fields_ = [
        ("value", ctypes.c_double),
        ("kind", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.Command.v1"


assert ctypes.sizeof(Command) == 16


class Response(ctypes.Structure):
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("plan", PlanId),
        ("speed_scale", ctypes.c_double),
        ("verdict", ctypes.c_uint32),
        ("mode", ctypes.c_uint32),
        ("fault", ctypes.c_uint32),
        ("knot", ctypes.c_uint32),
        ("unverified", ctypes.c_uint32),
        ("stopped", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.Response.v2"


assert ctypes.sizeof(Response) == 56


class BaseOrder(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    STATUS = 0
    DRIVE = 1
    ARRIVED = 2


class BaseState(enum.IntEnum):
    @property
    def text(self):
        return _TEXTS[type(self)][self]

    IDLE = 0
    DRIVING = 1
    ARRIVED = 2
    FAILED = 3


_TEXTS[BaseOrder] = {
    BaseOrder.STATUS: "status",
    BaseOrder.DRIVE: "drive",
    BaseOrder.ARRIVED: "arrived",
}
_TEXTS[BaseState] = {
    BaseState.IDLE: "idle",
    BaseState.DRIVING: "driving",
    BaseState.ARRIVED: "arrived",
    BaseState.FAILED: "failed",
}


class BaseJoint(ctypes.Structure):
    _fields_ = [
        ("name", ctypes.c_uint8 * 64),
        ("position", ctypes.c_double),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.BaseJoint.v1"


assert ctypes.sizeof(BaseJoint) == 72


class BaseCommand(ctypes.Structure):
    _fields_ = [
        ("goal", ctypes.c_uint64),
        ("pose", ctypes.c_double * 3),
        ("joints", BaseJoint * 32),
        ("joint_count", ctypes.c_uint32),
        ("order", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.BaseCommand.v1"


assert ctypes.sizeof(BaseCommand) == 2344


class BaseStatus(ctypes.Structure):
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("goal", ctypes.c_uint64),
        ("pose", ctypes.c_double * 3),
        ("verdict", ctypes.c_uint32),
        ("state", ctypes.c_uint32),
        ("measured", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name():
        return "nullsweep.BaseStatus.v1"


assert ctypes.sizeof(BaseStatus) == 56
