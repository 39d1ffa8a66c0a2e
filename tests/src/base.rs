//! A simulated base: it is asked for a pose and takes its time to get there. No clock and no port, so that
//! a test runs it in virtual time.

use nullsweep_ipc_types::{BaseCommand, BaseJoint, BaseOrder, BaseState, BaseStatus, Verdict};
use nullsweep_robot::wrap;

/// How fast it drives, turns and moves a lift. \[m/s\], \[rad/s\], \[m/s\] or \[rad/s\]
const SPEEDS: [f64; 3] = [0.5, 0.8, 0.1];

/// The base.
#[derive(Clone, Debug)]
pub struct Base {
    pose: [f64; 3],
    /// Joints that it can set, by name. \[rad\] or \[m\]
    joints: Vec<(String, f64)>,
    /// How far off it stands where it says it was asked to. x, y \[m\], yaw \[rad\]
    off: [f64; 3],
    goal: u64,
    state: BaseState,
    drive: Option<Drive>,
    drives: u64,
}

/// A motion between two poses, as even as it is long.
#[derive(Clone, Debug)]
struct Drive {
    from: [f64; 3],
    to: [f64; 3],
    /// Which joints go from where to where.
    joints: Vec<(usize, f64, f64)>,
    start_ns: u64,
    seconds: f64,
}

impl Base {
    /// A base that stands at a pose, with joints that it can set. It ends each drive `off` its goal.
    #[must_use]
    pub fn new(pose: [f64; 3], joints: Vec<(String, f64)>, off: [f64; 3]) -> Self {
        Self { pose, joints, off, goal: 0, state: BaseState::Idle, drive: None, drives: 0 }
    }

    /// Where it is: x, y \[m\], yaw \[rad\].
    #[must_use]
    pub fn pose(&self) -> [f64; 3] {
        self.pose
    }

    /// The joints that it sets, and where they are. \[rad\] or \[m\]
    #[must_use]
    pub fn joints(&self) -> &[(String, f64)] {
        &self.joints
    }

    /// How often it was sent somewhere.
    #[must_use]
    pub fn drives(&self) -> u64 {
        self.drives
    }

    /// Takes an order.
    pub fn ask(&mut self, command: &BaseCommand, now_ns: u64) -> BaseStatus {
        self.advance(now_ns);
        let verdict = match BaseOrder::from_wire(command.order) {
            Some(BaseOrder::Status) => Verdict::Accepted,
            // It knows by itself.
            Some(BaseOrder::Arrived) => Verdict::WrongMode,
            Some(BaseOrder::Drive) => match self.drive(command, now_ns) {
                Some(drive) => {
                    (self.goal, self.state) = (command.goal, BaseState::Driving);
                    self.drive = Some(drive);
                    self.drives += 1;
                    Verdict::Accepted
                }
                None => Verdict::BadValue,
            },
            None => Verdict::Unknown,
        };
        BaseStatus {
            stamp_ns: now_ns,
            goal: self.goal,
            pose: self.pose,
            verdict: verdict.wire(),
            state: self.state.wire(),
            measured: 1,
            reserved: 0,
        }
    }

    /// The motion that is asked for; `None` where it is none.
    fn drive(&self, command: &BaseCommand, now_ns: u64) -> Option<Drive> {
        let joint = |asked: &BaseJoint| {
            let at =
                self.joints.iter().position(|(name, _)| asked.name() == Some(name.as_str()))?;
            asked.position.is_finite().then(|| (at, self.joints[at].1, asked.position))
        };
        let joints: Vec<_> = command.joints().iter().map(joint).collect::<Option<_>>()?;
        if command.goal == 0 || command.pose.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let (from, to) = (self.pose, [0, 1, 2].map(|i| command.pose[i] + self.off[i]));
        let way = (to[0] - from[0]).hypot(to[1] - from[1]);
        let lift = joints.iter().map(|(_, from, to)| (to - from).abs()).fold(0.0, f64::max);
        let parts = [way, wrap(to[2] - from[2]).abs(), lift];
        let seconds =
            parts.iter().zip(SPEEDS).map(|(part, speed)| part / speed).fold(0.0, f64::max);
        Some(Drive { from, to, joints, start_ns: now_ns, seconds })
    }

    /// Moves on to a moment.
    pub fn advance(&mut self, now_ns: u64) {
        let Some(drive) = &self.drive else { return };
        let passed = now_ns.saturating_sub(drive.start_ns) as f64 * 1e-9;
        let share = if passed < drive.seconds { passed / drive.seconds } else { 1.0 };
        let between = |from: f64, way: f64| from + share * way;
        let [x, y, yaw] = [0, 1, 2].map(|i| drive.to[i] - drive.from[i]);
        let from = drive.from;
        self.pose = [between(from[0], x), between(from[1], y), between(from[2], wrap(yaw))];
        for &(at, from, to) in &drive.joints {
            // The end to the bit: plans hold joints there.
            self.joints[at].1 = if share < 1.0 { between(from, to - from) } else { to };
        }
        if share >= 1.0 {
            self.pose = drive.to;
            self.state = BaseState::Arrived;
            self.drive = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn drive(goal: u64, pose: [f64; 3], lift: Option<(&str, f64)>) -> BaseCommand {
        let mut command = BaseCommand { goal, pose, ..BaseCommand::of(BaseOrder::Drive) };
        if let Some((name, at)) = lift {
            command.joints[0] = BaseJoint::new(name, at).expect("a short name");
            command.joint_count = 1;
        }
        command
    }

    fn base(off: [f64; 3]) -> Base {
        Base::new([0.0; 3], vec![("head".into(), 0.0), ("lift".into(), 0.1)], off)
    }

    #[test]
    fn it_drives_takes_its_time_and_arrives() {
        let mut base = base([0.0; 3]);
        let status = BaseCommand::of(BaseOrder::Status);
        assert_eq!(base.ask(&status, 0).state, BaseState::Idle.wire());
        // 2 m at 0.5 m/s; the lift is there sooner.
        let begun = base.ask(&drive(7, [2.0, 0.0, 0.5], Some(("lift", 0.3))), S);
        assert_eq!((begun.goal, begun.state), (7, BaseState::Driving.wire()));
        let midway = base.ask(&status, 3 * S);
        assert_eq!(midway.state, BaseState::Driving.wire());
        assert!((midway.pose[0] - 1.0).abs() < 1e-9 && (midway.pose[2] - 0.25).abs() < 1e-9);
        assert!((base.joints()[1].1 - 0.2).abs() < 1e-9);
        let arrived = base.ask(&status, 5 * S);
        assert_eq!((arrived.state, arrived.pose), (BaseState::Arrived.wire(), [2.0, 0.0, 0.5]));
        assert_eq!((base.joints()[0].1, base.joints()[1].1, base.drives()), (0.0, 0.3, 1));
        // By the shorter turn.
        base.ask(&drive(8, [2.0, 0.0, 0.5 + 6.0], None), 6 * S);
        base.advance(60 * S);
        assert_eq!(base.pose()[2], 6.5);
    }

    #[test]
    fn it_stands_off_where_it_is_told_to_and_refuses_nonsense() {
        let mut base = base([0.01, 0.0, -0.02]);
        let refused = |base: &mut Base, command: &BaseCommand| {
            let verdict = base.ask(command, 0).verdict;
            assert_eq!(base.state, BaseState::Idle);
            verdict
        };
        for nonsense in [
            drive(1, [f64::NAN, 0.0, 0.0], None),
            drive(0, [0.0; 3], None),
            drive(1, [0.0; 3], Some(("elbow", 0.1))),
            drive(1, [0.0; 3], Some(("lift", f64::INFINITY))),
        ] {
            assert_eq!(refused(&mut base, &nonsense), Verdict::BadValue.wire());
        }
        let said = BaseCommand::of(BaseOrder::Arrived);
        assert_eq!(refused(&mut base, &said), Verdict::WrongMode.wire());
        let unknown = BaseCommand { order: 9, ..said };
        assert_eq!(refused(&mut base, &unknown), Verdict::Unknown.wire());
        base.ask(&drive(1, [1.0, 0.0, 0.0], None), 0);
        base.advance(10 * S);
        assert_eq!(base.pose(), [1.01, 0.0, -0.02]);
    }
}
