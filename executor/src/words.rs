//! What happened, in words: each with joint names, units and what to do.

use std::fmt::Write;

use nullsweep_cell::as_called;
use nullsweep_ipc_types::{
    Command, CommandKind, EventKind, Fault, Mode, Reason, Response, Verdict,
};
use nullsweep_robot::{Arm, JointKind};

use crate::admit::Rejection;
use crate::cycle::{Event, Snapshot};

/// A joint as people know it.
#[derive(Clone, Debug)]
struct Name {
    name: String,
    /// Of a position.
    unit: &'static str,
}

/// The names of one system.
#[derive(Clone, Debug)]
pub(crate) struct Words {
    robot: String,
    joints: Vec<Name>,
    held: Vec<Name>,
}

impl Words {
    pub(crate) fn of(arm: &Arm, robot: &str) -> Self {
        let unit = |turns: bool| if turns { "rad" } else { "m" };
        let joints = arm.joint_names().iter().enumerate();
        let joints =
            joints.map(|(j, name)| Name { name: name.clone(), unit: unit(arm.is_revolute(j)) });
        let model = arm.robot();
        let slides = |name: &str| {
            model.joints().iter().any(|j| j.name == name && j.kind == JointKind::Prismatic)
        };
        let held = arm.held_joints().iter();
        let held = held.map(|h| Name { name: h.name.clone(), unit: unit(!slides(&h.name)) });
        Self { robot: robot.into(), joints: joints.collect(), held: held.collect() }
    }

    /// What became of a plan.
    pub(crate) fn event(&self, event: &Event) -> String {
        let mut text = format!("plan {} {}", event.plan, event.kind);
        if event.kind == EventKind::Accepted {
            let _ = write!(text, " {:.2} ms after it was published", event.why.value * 1e3);
        } else if event.why.reason != Reason::None {
            let _ = write!(text, ": {}{}", event.why.reason, self.place(&event.why));
            let remedy = remedy(event.why.reason, event.kind);
            if !remedy.is_empty() {
                let _ = write!(text, "; {remedy}");
            }
        }
        as_called(text)
    }

    /// Where a rule is broken and by how much.
    fn place(&self, why: &Rejection) -> String {
        let Rejection { reason, joint, knot, value, bound } = *why;
        let mut text = String::new();
        if knot != u32::MAX {
            let _ = write!(text, ", knot {knot}");
        }
        let all = if reason == Reason::HeldJoint { &self.held } else { &self.joints };
        let count = all.len() as f64;
        // Their number was wrong, not a position.
        if reason == Reason::HeldJoint && bound == count && f64::from(joint) == value.min(bound) {
            let _ = write!(text, ": {value} held joints were given, the robot has {count}");
            return text;
        }
        let named = (joint != u32::MAX).then(|| all.get(joint as usize)).flatten();
        let unit = named.map_or("", |n| n.unit);
        if let Some(named) = named {
            let _ = write!(text, ", joint {}", named.name);
        }
        if value.is_nan() && bound.is_nan() {
            return text;
        }
        let per_second = matches!(reason, Reason::Velocity | Reason::Corner | Reason::Speed);
        let unit = match reason {
            Reason::TimeOrder | Reason::Epoch => " ns".into(),
            _ if unit.is_empty() => String::new(),
            Reason::Acceleration => format!(" {unit}/s²"),
            Reason::Jerk => format!(" {unit}/s³"),
            _ if per_second => format!(" {unit}/s"),
            _ => format!(" {unit}"),
        };
        let _ = match reason {
            Reason::HeldJoint => {
                write!(text, ": planned for {value:.4}{unit}, measured at {bound:.4}{unit}")
            }
            Reason::Start | Reason::Speed => {
                write!(text, ": {value:.6}{unit} off, at most {bound:.6}{unit}")
            }
            Reason::Corner => {
                write!(text, ": a step of {value:.4}{unit}, at most {bound:.4}{unit}")
            }
            Reason::SoftLimit | Reason::Velocity | Reason::Acceleration | Reason::Jerk => {
                write!(text, ": {value:.4}{unit} against the limit {bound:.4}{unit}")
            }
            _ if bound.is_nan() => write!(text, ": {value}{unit}"),
            _ => write!(text, ": {value}{unit} against {bound}{unit}"),
        };
        text
    }

    /// A fault that is latched, or for which the arm was stopped.
    pub(crate) fn fault(&self, now: &Snapshot) -> String {
        let mut text = now.fault.to_string();
        let farthest = (0..self.joints.len())
            .max_by(|a, b| apart(now, *a).total_cmp(&apart(now, *b)))
            .filter(|_| now.fault == Fault::FollowingError);
        if let Some(j) = farthest {
            let Name { name, unit } = &self.joints[j];
            let (commanded, measured) = (now.commanded[j], now.measured[j]);
            let _ = write!(
                text,
                ": {name} is commanded to {commanded:.4} {unit}, measured at {measured:.4} {unit}"
            );
        }
        let _ = write!(text, "; {}", self.cure(now.fault));
        as_called(text)
    }

    /// What the executor waits for in [`Mode::Init`].
    pub(crate) fn waiting(&self, now: &Snapshot) -> String {
        let cause = match now.fault {
            Fault::None => "no joint state has come",
            other => other.text(),
        };
        let robot = &self.robot;
        as_called(match now.fault {
            Fault::None | Fault::StaleState => format!(
                "waiting for the hardware endpoint: {cause}; start one for robot `{robot}` \
                 (--robot-name) under the same --ipc-root"
            ),
            other => format!("waiting for the hardware endpoint: {cause}; {}", self.cure(other)),
        })
    }

    fn cure(&self, fault: Fault) -> String {
        let text = match fault {
            Fault::None => "nothing is to be done",
            Fault::StaleState => {
                "the endpoint or the machine stalled: publish again; the bound is --stale-ms"
            }
            Fault::CommunicationLost => {
                "start the hardware endpoint again, then `executor ctl reset`"
            }
            Fault::Answer => {
                "the endpoint must say in each state which setpoint it follows (docs/endpoints.md); \
                 then `executor ctl reset`"
            }
            Fault::Clock => {
                "the endpoint must stamp its states by CLOCK_MONOTONIC of this machine; then \
                 `executor ctl reset`"
            }
            Fault::Halted => "release the run stop, then `executor ctl resume`",
            Fault::NotCalibrated => "calibrate the arm, then `executor ctl reset`",
            Fault::Endpoint => "the endpoint's own log says why; then `executor ctl reset`",
            Fault::FollowingError => {
                "look what holds the arm, then `executor ctl reset`; the bounds are \
                 --following-error and --following-lag"
            }
            Fault::SoftLimit | Fault::Step | Fault::NotFinite => {
                "no setpoint of this kind was sent; keep the flight recording (--record), then \
                 `executor ctl reset`"
            }
            Fault::LowRate => {
                "give the executor a CPU and SCHED_FIFO (--cpu, --priority), then `executor ctl \
                 reset`; the bound is --min-rate"
            }
            Fault::JointCount => {
                return format!(
                    "the arm has {} joints: start endpoint and executor with the same --urdf and \
                     --arm, then `executor ctl reset`",
                    self.joints.len()
                );
            }
            Fault::HeldJoint => {
                "keep torso and other arm still, then publish again; the bound is --held-tolerance"
            }
        };
        text.into()
    }
}

/// How far the arm is from its command. \[rad\] or \[m\]
fn apart(now: &Snapshot, joint: usize) -> f64 {
    (now.commanded[joint] - now.measured[joint]).abs()
}

/// An operator's command and how it was taken.
pub(crate) fn command(command: &Command, response: &Response) -> String {
    let mut text = CommandKind::from_wire(command.kind)
        .map_or_else(|| format!("command {}", command.kind), |kind| format!("command {kind}"));
    if command.kind == CommandKind::Speed.wire() {
        let _ = write!(text, " {:.0} %", command.value * 100.0);
    }
    let verdict = Verdict::from_wire(response.verdict).unwrap_or(Verdict::Unknown);
    let mode = Mode::from_wire(response.mode).map_or("unknown", Mode::text);
    let _ = write!(text, ": {verdict}, mode {mode}");
    text += match verdict {
        Verdict::Accepted => "",
        Verdict::WrongMode => "; `executor ctl status` says what is going on",
        Verdict::BadValue => "; speed goes from 0 to 100 %",
        Verdict::Unknown => "; the sender is of another version",
        Verdict::StillFaulty => {
            "; the arm must stand still and a sound endpoint must send: see the last fault"
        }
        Verdict::Busy => "; ask again",
    };
    as_called(text)
}

/// What to do about a plan that was refused or ended early.
fn remedy(reason: Reason, kind: EventKind) -> &'static str {
    match reason {
        Reason::None | Reason::Shutdown => "",
        Reason::Stopped if kind == EventKind::Aborted => {
            "`planner replan --running PLAN SCAN…` goes on with what it has left"
        }
        Reason::Stopped => "",
        Reason::Malformed => "its sender must be of this executor's version",
        Reason::Checksum => "publish it again, and let nobody write to it meanwhile",
        Reason::Robot => "plan with this executor's --urdf and arm",
        Reason::HeldJoint if kind == EventKind::Rejected => {
            "move it there, or plan for where it stands (--held, --torso)"
        }
        Reason::HeldJoint => "keep torso and other arm still and publish again",
        Reason::NotFinite | Reason::TimeOrder => "its sender is at fault",
        Reason::SoftLimit => "plan within this executor's limits: with the same --urdf",
        Reason::Velocity => "plan within this executor's limits: the same --urdf, a lower --v-max",
        Reason::Acceleration => {
            "plan within this executor's limits (the same --urdf, --profile acceleration), or stop \
             before it (--join stop)"
        }
        Reason::Corner => {
            "bang-bang is for plans whose header says so (`corners`); else send a curve (--profile \
             acceleration)"
        }
        Reason::Jerk => "plan slower than this executor's limits: the same --urdf, a lower --v-max",
        Reason::Goal => "look what holds the arm; the bounds are --goal-tolerance and --goal-ms",
        Reason::Repeated => "nothing: the plan that came first counts; publish gives a new id",
        Reason::Start => "plan from where the arm holds (--start), or take the arm there first",
        Reason::Speed => {
            "it takes over from a plan that runs: `planner replan --running PLAN SCAN…` plans from where \
             the arm stands"
        }
        Reason::JoinPlan => "publish with --join stop, or continue the plan that runs",
        Reason::JoinKnot => "continue from a later knot (--continue PLAN@K)",
        Reason::NotReady => "`executor ctl status` says what is going on",
        Reason::QueueFull => "wait for the end of an earlier plan",
        Reason::Epoch => "publish it again: plans from before this executor's start are not run",
        Reason::Fault => "the fault's own line says what to do",
    }
}

#[cfg(test)]
mod tests {
    use nullsweep_ipc_types::PlanId;
    use nullsweep_robot::{ArmSpec, Robot, Side};

    use super::*;
    use crate::JointVector;
    use crate::cycle::Refused;

    fn words() -> Words {
        let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
        Words::of(&arm, "pr2")
    }

    fn rejected(why: Rejection) -> String {
        let plan = PlanId { epoch: 3, number: 1 };
        words().event(&Event { plan, kind: EventKind::Rejected, why })
    }

    fn snapshot(mode: Mode, fault: Fault) -> Snapshot {
        Snapshot {
            cycle: 1,
            missed: 0,
            mode,
            fault,
            plan: PlanId::NONE,
            unverified: false,
            knot: 0,
            stopped: None,
            plan_time_ns: 0,
            rate: 0.0,
            scale: 1.0,
            commanded: JointVector::ZERO,
            measured: JointVector::ZERO,
            refused: Refused::default(),
        }
    }

    #[test]
    fn a_rejection_names_joint_unit_and_remedy() {
        let off = |reason| rejected(Rejection::new(reason).knot(0).joint(0).value(0.35, 0.02));
        let text = off(Reason::Start);
        assert!(
            text.contains("knot 0, joint r_shoulder_pan_joint: 0.350000 rad off, at"),
            "{text}"
        );
        assert!(text.contains("; plan from where the arm holds"), "{text}");
        let text = off(Reason::Speed);
        assert!(text.contains("0.350000 rad/s off") && text.contains("`planner replan"), "{text}");
        let text = rejected(Rejection::new(Reason::Velocity).knot(4).joint(1).value(3.0, 2.0));
        assert!(text.contains("r_shoulder_lift_joint: 3.0000 rad/s against the limit"), "{text}");
        let torso = words().held.iter().position(|h| h.name == "torso_lift_joint");
        let held = Rejection::new(Reason::HeldJoint).joint(torso.expect("a torso"));
        let text = rejected(held.value(0.3, 0.1));
        let told = "joint torso_lift_joint: planned for 0.3000 m, measured at 0.1000 m; move it";
        assert!(text.contains(told), "{text}");
        let text = rejected(Rejection::new(Reason::HeldJoint).joint(2).value(2.0, held_count()));
        assert!(text.contains("2 held joints were given"), "{text}");
    }

    fn held_count() -> f64 {
        words().held.len() as f64
    }

    #[test]
    fn every_reason_and_fault_has_its_line() {
        for reason in Reason::ALL {
            let text = rejected(Rejection::new(*reason));
            let silent = matches!(reason, Reason::None | Reason::Stopped | Reason::Shutdown);
            assert_eq!(text.contains(';'), !silent, "{text}");
        }
        let words = words();
        let plan = PlanId { epoch: 3, number: 1 };
        let why = Rejection::new(Reason::Stopped).knot(270);
        let text = words.event(&Event { plan, kind: EventKind::Aborted, why });
        let told = "stopped by command, knot 270; `planner replan --running PLAN";
        assert!(text.contains(told), "{text}");
        for fault in Fault::ALL {
            let text = words.fault(&snapshot(Mode::Fault, *fault));
            assert!(text.contains(fault.text()) && text.contains("; "), "{text}");
        }
        let mut strays = snapshot(Mode::Fault, Fault::FollowingError);
        strays.commanded[3] = -1.0;
        let text = words.fault(&strays);
        let told = "following error: r_elbow_flex_joint is commanded to -1.0000 rad, measured at 0";
        assert!(text.contains(told), "{text}");
        let text = words.waiting(&snapshot(Mode::Init, Fault::None));
        assert!(text.contains("no joint state has come; start one for robot `pr2`"), "{text}");
        let text = words.waiting(&snapshot(Mode::Init, Fault::NotCalibrated));
        assert!(text.contains("calibrate the arm"), "{text}");
    }
}
