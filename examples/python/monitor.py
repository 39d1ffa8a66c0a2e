"""Shows what an executor does, in one live line, and writes it as CSV.

    python3 monitor.py [--robot-name pr2] [--csv run.csv] [--seconds 60]
"""

import argparse
import csv
import sys
import time

import nullsweep_ipc
import nullsweep_types as types


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot-name", default="pr2")
    parser.add_argument("--ipc-root", help="iceoryx2's root path, if not the default")
    parser.add_argument("--csv", help="write every sample to this file")
    parser.add_argument("--seconds", type=float, default=float("inf"))
    args = parser.parse_args()

    ipc = nullsweep_ipc.Ipc(args.robot_name, args.ipc_root)
    telemetry = ipc.receiver("telemetry", types.Telemetry)
    events = ipc.receiver("plan_event", types.PlanEvent)
    table = csv.writer(open(args.csv, "w", newline="")) if args.csv else None
    end = time.monotonic() + args.seconds
    last, lost, samples = None, 0, 0
    try:
        while time.monotonic() < end:
            for event in events.all():
                kind, reason = types.EventKind(event.kind), types.Reason(event.reason)
                why = "" if reason == types.Reason.NONE else f": {reason.text}"
                print(f"\rplan {event.plan.epoch:x}/{event.plan.number} {kind.text}{why}\033[K")
            for t in telemetry.all():
                if last is not None:
                    lost += t.sequence - last - 1
                elif table:
                    joints = range(t.joint_count)
                    names = [f"{what}{j}" for what in ("commanded", "measured") for j in joints]
                    table.writerow(["stamp_ns", "mode", "fault", "plan_time_s", "knot"] + names)
                last, samples = t.sequence, samples + 1
                n = t.joint_count
                error = max((abs(t.commanded[j] - t.measured[j]) for j in range(n)), default=0.0)
                fault = types.Fault(t.fault)
                line = (f"{types.Mode(t.mode).text:9} knot {t.knot:5} "
                        f"{t.plan_time_ns * 1e-9:7.2f} s  speed {100 * t.speed_scale:3.0f} %  "
                        f"error {error:.4f} rad  missed {t.missed_cycles}")
                if t.lost_lines:
                    line += f"  log lines lost {t.lost_lines}"
                if t.unverified:
                    line += "  the plan is NOT VERIFIED"
                if fault != types.Fault.NONE:
                    line += f"  {fault.text}"
                print("\r" + line + "\033[K", end="", flush=True)
                if table:
                    table.writerow([t.stamp_ns, t.mode, t.fault, t.plan_time_ns * 1e-9, t.knot]
                                   + list(t.commanded[:n]) + list(t.measured[:n]))
            time.sleep(0.02)
    except KeyboardInterrupt:
        pass
    print(f"\n{samples} samples, {lost} lost")
    sys.exit(0 if samples else "no telemetry came: is an executor running for this robot?")


if __name__ == "__main__":
    main()
