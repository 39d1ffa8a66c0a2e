"""Opens Nullsweep's services from Python. Needs iceoryx2 of exactly the version of the Rust side:

    pip install iceoryx2==0.10.0
"""

import ctypes
import pathlib
import sys
import time

import nullsweep_types as types

try:
    import iceoryx2 as iox2
except ImportError:
    sys.exit("the Python package iceoryx2 is missing: pip install iceoryx2==0.10.0")


def now_ns():
    """The clock of every stamp."""
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def refuse_empty(prefix):
    """iceoryx2 waits without end on a segment of length 0, as a process leaves that died while it
    made it. One that is just being made has a length a moment later."""
    end = time.monotonic() + 3.0
    while True:
        empty = sorted(p for p in pathlib.Path("/dev/shm").glob(prefix + "*") if length(p) == 0)
        if not empty:
            return
        if time.monotonic() > end:
            sys.exit(f"{empty[0]} is empty: a process died while it made it, or another user wrote "
                     "to it; remove it and try again: no process that runs needs it")
        time.sleep(0.025)


def length(path):
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return None


class Ipc:
    """One process's door to a robot's services. `root` is what --ipc-root is on the Rust side; it
    must be given together with the prefix that the Rust side derives from it, see `prefix_of`."""

    def __init__(self, robot="pr2", root=None):
        iox2.set_log_level_from_env_or(iox2.LogLevel.Error)
        builder = iox2.NodeBuilder.new()
        if root is not None:
            config = iox2.config.default()
            config.global_cfg.root_path = iox2.Path.new(root)
            config.global_cfg.prefix = iox2.FileName.new(prefix_of(root))
            builder = builder.config(config)
        refuse_empty("iox2_" if root is None else prefix_of(root))
        self.robot = robot
        self.node = builder.create(iox2.ServiceType.Ipc)

    def _service(self, name, payload, header=None):
        publishers, subscribers, buffer, history, borrowed, overflow = types.SERVICES[name]
        full = iox2.ServiceName.new(f"nullsweep/{self.robot}/{name}")
        builder = self.node.service_builder(full).publish_subscribe(payload)
        if header is not None:
            builder = builder.user_header(header)
        return (
            builder.max_publishers(publishers)
            .max_subscribers(subscribers)
            .max_nodes(types.MAX_NODES)
            .subscriber_max_buffer_size(buffer)
            .subscriber_max_borrowed_samples(borrowed)
            .history_size(history)
            .enable_safe_overflow(overflow)
            .open_or_create()
        )

    def receiver(self, name, payload):
        """Reads a stream."""
        return Receiver(self._service(name, payload), types.SERVICES[name][2], payload)

    def sender(self, name, payload):
        """Writes a stream. There is one sender of each."""
        return Sender(self._service(name, payload), payload)

    def plan_publisher(self, knots):
        """Sends plans of up to so many knots."""
        return PlanPublisher(self._service("plan", iox2.Slice[types.Knot], types.PlanHeader), knots)


class Receiver:
    """The receiving end of a stream."""

    def __init__(self, service, buffer, payload):
        self._service, self._payload = service, payload
        self._port = service.subscriber_builder().buffer_size(buffer).create()

    def receive(self):
        """A copy of the oldest sample that waits, or None."""
        sample = self._port.receive()
        if sample is None:
            return None
        copy = self._payload.from_buffer_copy(sample.payload().contents)
        sample.delete()
        return copy

    def all(self):
        """What waits, oldest first."""
        while (value := self.receive()) is not None:
            yield value


class Sender:
    """The sending end of a stream. Sending never blocks."""

    def __init__(self, service, payload):
        self._service = service
        self._port = (
            service.publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .create()
        )

    def send(self, value):
        """Sends a copy."""
        self._port.send_copy(value)


class PlanPublisher:
    """A planner's end of the plan service. Keep it until the admission has come: a publisher that
    goes takes its plan with it."""

    def __init__(self, service, knots):
        self._service = service
        self._count = 0
        self._port = (
            service.publisher_builder()
            .initial_max_slice_len(knots)
            .max_loaned_samples(1)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .allocation_strategy(iox2.AllocationStrategy.Static)
            .create()
        )

    def publish(self, header, knots):
        """Gives the plan its id and its checksum and sends it; the id, or None without executor."""
        self._count += 1
        header.id.epoch, header.id.number = now_ns(), self._count
        header.knot_count = len(knots)
        header.checksum = 0
        header.checksum = checksum(bytes(header) + b"".join(bytes(k) for k in knots))
        sample = self._port.loan_slice_uninit(len(knots))
        ctypes.memmove(sample.user_header(), ctypes.byref(header), ctypes.sizeof(header))
        payload = sample.payload()
        for i, knot in enumerate(knots):
            payload[i] = knot
        reached = sample.assume_init().send()
        return types.PlanId(header.id.epoch, header.id.number) if reached else None


def _xxh3():
    try:
        import xxhash
    except ImportError:
        sys.exit("the Python package xxhash is missing: pip install xxhash")
    return xxhash.xxh3_64_intdigest


def checksum(data):
    """What seals a plan: xxh3 over the header (its checksum 0) and the knots."""
    return _xxh3()(data)


def prefix_of(root):
    """The prefix of shared-memory segments below a root path of one's own."""
    return f"nsw_{_xxh3()(str(root).encode()) >> 32:08x}_"
