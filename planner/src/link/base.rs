//! Where the robot's base is to be: asked of what drives it, or of a person who does.

use std::time::Duration;

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_ipc_types::ports::{BaseClient, BaseServer, Ipc, IpcError, PortError, now_ns};
use nullsweep_ipc_types::{
    BaseCommand, BaseJoint, BaseOrder, BaseState, BaseStatus, MAX_HELD_JOINTS, Verdict,
};

use crate::plan::{Plan, ProgramStop};
use crate::workcell::stance::told;

/// How long an answer is waited for.
const ANSWER: Duration = Duration::from_secs(2);
/// How often the base is asked how far it is.
const LOOK: Duration = Duration::from_millis(50);

/// Why the base is not where it was to be.
#[derive(Debug, thiserror::Error)]
pub enum BaseError {
    /// The service cannot be opened, or nobody answers any more.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A port failed.
    #[error("waiting for the base: {0}")]
    Port(#[from] PortError),
    /// The wire cannot carry a joint that is to be set.
    #[error("the base cannot be asked to set {joint}: {why}")]
    Joint {
        /// Its name.
        joint: String,
        /// Why.
        why: &'static str,
    },
    /// The drive was not begun.
    #[error("the base does not drive to {}: {}", told(.to), .verdict.text())]
    Refused {
        /// Where it was to go.
        to: [f64; 3],
        /// How the order was taken.
        verdict: Verdict,
    },
    /// It has given up.
    #[error("the base has given up on its way to {}, it stands at {}", told(.to), told(.at))]
    Failed {
        /// Where it was to go.
        to: [f64; 3],
        /// Where it is.
        at: [f64; 3],
    },
    /// Somebody else has sent it elsewhere.
    #[error("somebody else has sent the base elsewhere on its way to {}", told(.to))]
    Elsewhere {
        /// Where it was to go.
        to: [f64; 3],
    },
}

/// Where the base stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stands {
    /// The root frame in the floor frame: x, y \[m\], yaw \[rad\].
    pub pose: [f64; 3],
    /// Whether that was measured; else it is where the base was asked to be.
    pub measured: bool,
}

/// Who moves the base.
#[derive(Debug)]
pub enum Mover {
    /// A program that drives it.
    Driver(BaseClient),
    /// A person, who says `executor ctl arrived`.
    Person(BaseServer),
}

impl Mover {
    /// The driver that answers for this robot; without one this process waits for a person's word in its
    /// place.
    ///
    /// # Errors
    /// See [`BaseError`].
    pub fn find(ipc: &Ipc) -> Result<Self, BaseError> {
        // A driver that was killed stays in the service's books until somebody sweeps.
        ipc.sweep_dead_nodes();
        let client = ipc.base_client()?;
        if client.is_answered() {
            return Ok(Self::Driver(client));
        }
        drop(client);
        Ok(Self::Person(ipc.base_server()?))
    }

    /// Where the base stands, as far as somebody measures that; nothing while it drives.
    ///
    /// # Errors
    /// See [`BaseError`].
    pub fn stands(&self) -> Result<Option<Stands>, BaseError> {
        let Self::Driver(client) = self else { return Ok(None) };
        let status = client.call(BaseCommand::of(BaseOrder::Status), ANSWER)?;
        let still = status.measured != 0 && status.state != BaseState::Driving.wire();
        Ok(still.then_some(Stands { pose: status.pose, measured: true }))
    }

    /// Has the base stand where a stop has it, its joints set, and waits for that.
    ///
    /// # Errors
    /// See [`BaseError`].
    pub fn drive(&self, stop: &ProgramStop) -> Result<Stands, BaseError> {
        let goal = order(stop)?;
        match self {
            Self::Driver(client) => driven(client, &goal),
            Self::Person(server) => confirmed(server, &goal),
        }
    }
}

const TOO_MANY: &str = "a stop sets at most 32 joints";
const _: () = assert!(MAX_HELD_JOINTS == 32);

/// The order to drive to a stop.
fn order(stop: &ProgramStop) -> Result<BaseCommand, BaseError> {
    let mut goal =
        BaseCommand { goal: now_ns(), pose: stop.base, ..BaseCommand::of(BaseOrder::Drive) };
    for (k, (name, position)) in stop.held.iter().enumerate() {
        let wrong = |why| BaseError::Joint { joint: name.clone(), why };
        let slot = goal.joints.get_mut(k);
        let slot = slot.ok_or_else(|| wrong(TOO_MANY))?;
        let joint = BaseJoint::new(name, *position);
        *slot = joint.ok_or_else(|| wrong("its name is longer than 64 bytes"))?;
        goal.joint_count = (k + 1) as u32;
    }
    Ok(goal)
}

/// Sends the driver there and waits.
fn driven(client: &BaseClient, goal: &BaseCommand) -> Result<Stands, BaseError> {
    let to = goal.pose;
    let mut status = client.call(*goal, ANSWER)?;
    let verdict = Verdict::from_wire(status.verdict).unwrap_or(Verdict::Unknown);
    if verdict != Verdict::Accepted {
        return Err(BaseError::Refused { to, verdict });
    }
    loop {
        if status.goal != goal.goal {
            return Err(BaseError::Elsewhere { to });
        }
        match BaseState::from_wire(status.state) {
            Some(BaseState::Arrived) => {
                return Ok(Stands { pose: status.pose, measured: status.measured != 0 });
            }
            Some(BaseState::Failed) => return Err(BaseError::Failed { to, at: status.pose }),
            _ => std::thread::sleep(LOOK),
        }
        status = client.call(BaseCommand::of(BaseOrder::Status), ANSWER)?;
    }
}

/// Waits for a person's word.
fn confirmed(server: &BaseServer, goal: &BaseCommand) -> Result<Stands, BaseError> {
    loop {
        while let Some(request) = server.receive()? {
            let order = BaseOrder::from_wire(request.command().order);
            let arrived = order == Some(BaseOrder::Arrived);
            let (verdict, state) = match order {
                Some(BaseOrder::Arrived) => (Verdict::Accepted, BaseState::Arrived),
                Some(BaseOrder::Status) => (Verdict::Accepted, BaseState::Driving),
                // A second program: the base is the first one's.
                Some(BaseOrder::Drive) => (Verdict::WrongMode, BaseState::Driving),
                None => (Verdict::Unknown, BaseState::Driving),
            };
            request.answer(BaseStatus {
                stamp_ns: now_ns(),
                goal: goal.goal,
                pose: goal.pose,
                verdict: verdict.wire(),
                state: state.wire(),
                measured: 0,
                reserved: 0,
            })?;
            if arrived {
                return Ok(Stands { pose: goal.pose, measured: false });
            }
        }
        std::thread::sleep(LOOK);
    }
}

/// How far, at most, what a plan can reach of its surface lies from where the plan has it, with the base
/// where it stands; without end where that is no place. \[m\]
#[must_use]
pub fn displacement(plan: &Plan, stands: [f64; 3]) -> f64 {
    let [x, y, yaw] = stands;
    if stands.iter().any(|value| !value.is_finite()) {
        return f64::INFINITY;
    }
    let here = Isometry3::new(Vector3::new(x, y, plan.base_height), Vector3::z() * yaw);
    let moved = here.inverse() * plan.base_pose();
    let apart = |p: &[f64; 3]| (moved * Point3::from(*p) - Point3::from(*p)).norm();
    let reachable = plan.surface.iter().filter(|sample| sample.reachable);
    reachable.map(|sample| apart(&sample.point)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use bytemuck::Zeroable;
    use nullsweep_robot::{ArmSpec, Robot, Side, Tool};
    use tempfile::TempDir;

    use super::*;
    use crate::plan::SurfaceSample;

    fn stop() -> ProgramStop {
        ProgramStop {
            base: [1.0, 2.0, 0.5],
            base_height: 0.0,
            held: vec![("torso_lift_joint".into(), 0.2)],
            drive_m: 1.0,
            works: Vec::new(),
            together: Vec::new(),
        }
    }

    /// Answers every question by `answer` until a drive has come to its end.
    fn driver(root: &TempDir, answers: u32, answer: impl Fn(&BaseCommand, u32) -> BaseStatus) {
        let ipc = Ipc::open("pr2", Some(root.path())).expect("services");
        let server = ipc.base_server().expect("the place is free");
        let (mut given, start) = (0, Instant::now());
        while given < answers && start.elapsed() < Duration::from_secs(20) {
            if let Some(request) = server.receive().expect("a port") {
                let status = answer(&request.command(), given);
                request.answer(status).expect("sent");
                given += 1;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        // Its last answer shall be read before it goes.
        std::thread::sleep(Duration::from_millis(200));
    }

    fn driven_by(
        answers: u32,
        answer: impl Fn(&BaseCommand, u32) -> BaseStatus + Sync,
    ) -> Result<Stands, BaseError> {
        let root = TempDir::new().expect("a folder");
        std::thread::scope(|s| {
            s.spawn(|| driver(&root, answers, &answer));
            let ipc = Ipc::open("pr2", Some(root.path())).expect("services");
            let start = Instant::now();
            loop {
                match Mover::find(&ipc) {
                    Ok(mover @ Mover::Driver(_)) => return mover.drive(&stop()),
                    _ => assert!(start.elapsed() < Duration::from_secs(20), "no driver came"),
                }
            }
        })
    }

    #[test]
    fn a_driver_is_sent_watched_and_believed() {
        let status = |goal, state: BaseState| BaseStatus {
            goal,
            state: state.wire(),
            measured: 1,
            pose: [1.0, 2.001, 0.5],
            ..BaseStatus::zeroed()
        };
        let goal = std::sync::atomic::AtomicU64::new(0);
        let asked = |command: &BaseCommand| {
            if command.order == BaseOrder::Drive.wire() {
                assert_eq!(command.joints()[0].name(), Some("torso_lift_joint"));
                goal.store(command.goal, std::sync::atomic::Ordering::Relaxed);
            }
            goal.load(std::sync::atomic::Ordering::Relaxed)
        };
        let arrives = |c: &BaseCommand, k| {
            status(asked(c), if k < 2 { BaseState::Driving } else { BaseState::Arrived })
        };
        let stands = driven_by(3, arrives).expect("it arrives");
        assert_eq!(stands, Stands { pose: [1.0, 2.001, 0.5], measured: true });

        let failed = driven_by(1, |c: &BaseCommand, _| status(asked(c), BaseState::Failed));
        assert!(matches!(failed, Err(BaseError::Failed { .. })), "{failed:?}");
        let other =
            driven_by(2, |c: &BaseCommand, k| status(asked(c) + u64::from(k), BaseState::Driving));
        assert!(matches!(other, Err(BaseError::Elsewhere { .. })), "{other:?}");
        let refused = driven_by(1, |c: &BaseCommand, _| BaseStatus {
            verdict: Verdict::BadValue.wire(),
            ..status(asked(c), BaseState::Idle)
        });
        assert!(matches!(refused, Err(BaseError::Refused { .. })), "{refused:?}");
    }

    #[test]
    fn without_a_driver_a_person_says_it_and_a_second_program_is_refused() {
        let root = TempDir::new().expect("a folder");
        let ipc = Ipc::open("pr2", Some(root.path())).expect("services");
        let mover = Mover::find(&ipc).expect("the place is free");
        assert!(matches!(mover, Mover::Person(_)));
        assert_eq!(mover.stands().expect("nobody measures"), None);
        std::thread::scope(|s| {
            s.spawn(|| {
                let ipc = Ipc::open("pr2", Some(root.path())).expect("services");
                let client = ipc.base_client().expect("a place");
                let say = |order| {
                    let long = Duration::from_secs(20);
                    client.call(BaseCommand::of(order), long).expect("an answer")
                };
                assert_eq!(say(BaseOrder::Drive).verdict, Verdict::WrongMode.wire());
                assert_eq!(say(BaseOrder::Status).state, BaseState::Driving.wire());
                assert_eq!(say(BaseOrder::Arrived).verdict, Verdict::Accepted.wire());
            });
            let stands = mover.drive(&stop()).expect("it is said");
            assert_eq!(stands, Stands { pose: [1.0, 2.0, 0.5], measured: false });
        });
    }

    #[test]
    fn how_far_the_surface_lies_off_comes_of_the_place_and_the_turn() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("the PR2 has a right arm");
        let plan = Plan::of(&robot, &arm, &Tool::default(), Vec::new());
        let sample = |x: f64, reachable| SurfaceSample {
            point: [x, 0.0, 0.5],
            normal: [0.0, 0.0, 1.0],
            reachable,
        };
        let surface = vec![sample(1.0, true), sample(3.0, false)];
        let plan = Plan { base: [2.0, 1.0, 0.3], surface, ..plan };
        assert!(displacement(&plan, [2.0, 1.0, 0.3]) < 1e-12);
        assert!((displacement(&plan, [2.0, 1.01, 0.3]) - 0.01).abs() < 1e-12);
        // Of what it can reach, 1 m away.
        assert!((displacement(&plan, [2.0, 1.0, 0.32]) - 0.02).abs() < 1e-5);
        for nowhere in [[f64::NAN, 1.0, 0.3], [2.0, 1.0, f64::INFINITY]] {
            assert_eq!(displacement(&plan, nowhere), f64::INFINITY);
        }
    }

    #[test]
    fn what_the_wire_cannot_carry_is_told() {
        let mut long = stop();
        long.held[0].0 = "x".repeat(65);
        assert!(order(&long).expect_err("too long").to_string().contains("64 bytes"));
        let many = ProgramStop { held: vec![("lift".into(), 0.0); 33], ..stop() };
        assert!(order(&many).expect_err("too many").to_string().contains("at most 32"));
    }
}
