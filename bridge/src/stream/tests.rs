//! A controller that takes messages, and setpoints with every trouble.

use nullsweep_robot::MAX_DOF;

use super::*;

const DOF: usize = 7;

const MS: u64 = 1_000_000;
/// The PR2's forearm and wrist turn without end.
const TURNS: [bool; 8] = [false, false, false, false, true, false, true, false];

fn rules() -> Rules {
    Rules {
        joints: DOF,
        takeover: Takeover::AtStamp,
        delay_ns: 60 * MS,
        timeout_ns: 20 * MS,
        stop_acceleration: 4.0,
        start_tolerance: 0.02,
        continuous: Continuous::new(TURNS),
    }
}

fn setpoint(sequence: u64, q: f64, v: f64) -> Setpoint {
    let mut s = <Setpoint as bytemuck::Zeroable>::zeroed();
    s.sequence = sequence;
    s.deadline_ns = 1000 * MS + sequence * MS;
    s.joint_count = DOF as u32;
    s.mode = Mode::Executing.wire();
    s.positions[0] = q;
    s.velocities[0] = v;
    s
}

#[test]
fn messages_join_where_setpoints_end_and_come_to_rest() {
    let mut stream = Stream::new(rules());
    let mut messages = Vec::new();
    for k in 1..=100u64 {
        let s = setpoint(k, 1e-3 * k as f64, 1.0);
        stream.take(&s, &JointVector::from_fn(|j| s.positions[j]));
        if k % 20 == 0 {
            messages.extend(stream.message(1000 * MS + k * MS));
        }
    }
    assert_eq!(messages.len(), 5);
    for pair in messages.windows(2) {
        let (a, b) = (&pair[0], &pair[1]);
        let joint = a.points[a.points.len() - 2];
        // The next one begins just before the last setpoint of this one is due.
        assert_eq!(b.start_ns + EARLY_NS, a.start_ns + joint.after_ns);
        assert_eq!(joint.v[0], 1.0);
    }
    for message in &messages {
        assert!(message.points.windows(2).all(|w| w[1].after_ns > w[0].after_ns));
        let [.., last, rest] = message.points[..] else { panic!("two points") };
        // 1 rad/s is stopped in 0.25 s over 0.125 rad.
        assert_eq!(rest.v, JointVector::ZERO);
        assert!((rest.q[0] - last.q[0] - 0.125).abs() < 1e-12);
        assert_eq!(rest.after_ns - last.after_ns, 250 * MS);
    }
    // What is measured 80 ms after a deadline was asked for 20 ms after it.
    assert_eq!(stream.in_force(1080 * MS + 60 * MS), Some((80, 1080 * MS)));
}

#[test]
fn what_is_too_late_or_too_far_is_not_followed() {
    let mut stream = Stream::new(rules());
    stream.take(&setpoint(1, 0.1, 0.0), &JointVector::ZERO);
    assert!(!stream.follows() && stream.refused == 1);
    // It says that it waits, so that the executor's setpoints come to the arm.
    assert!(stream.stopped(1001 * MS) == Some(Stop::Far) && stream.in_force(2000 * MS).is_none());
    stream.take(&setpoint(2, 0.01, 0.0), &JointVector::ZERO);
    assert!(stream.follows() && stream.stopped(1002 * MS).is_none());
    assert_eq!(stream.in_force(2000 * MS), Some((2, 1002 * MS)));
    // The process stalled: its stamp would lie in the past.
    assert_eq!(stream.message(1063 * MS), None);
    assert!(!stream.follows() && stream.late == 1);
    let mut nan = setpoint(3, 0.0, 0.0);
    nan.positions[3] = f64::NAN;
    stream.take(&nan, &JointVector::ZERO);
    assert!(!stream.follows());
}

/// The controller's part: at its stamp a message takes over, from the desired state there.
struct Controller {
    segments: Vec<(u64, u64, [[f64; 2]; 2])>,
}

impl Controller {
    fn at(&self, now: u64) -> [f64; 2] {
        let Some(&(start, end, [[q0, v0], [q1, v1]])) =
            self.segments.iter().rev().find(|s| s.0 <= now)
        else {
            return [0.0; 2];
        };
        if now > end {
            return [q1, 0.0];
        }
        let h = (end - start) as f64 * 1e-9;
        let u = (now - start) as f64 / (end - start) as f64;
        let (d, a, b) = (q1 - q0, v0 * h, v1 * h);
        let (c2, c3) = (3.0 * d - 2.0 * a - b, a + b - 2.0 * d);
        [q0 + u * (a + u * (c2 + u * c3)), (a + u * (2.0 * c2 + 3.0 * u * c3)) / h]
    }

    fn take(&mut self, message: &Message) {
        let mut from = (message.start_ns, self.at(message.start_ns));
        self.segments.retain(|s| s.0 < message.start_ns);
        for point in &message.points {
            let to = (message.start_ns + point.after_ns, [point.q[0], point.v[0]]);
            self.segments.push((from.0, to.0, [from.1, to.1]));
            from = to;
        }
    }
}

#[test]
fn following_begins_without_a_jump() {
    let mut stream = Stream::new(rules());
    let mut controller = Controller { segments: Vec::new() };
    // The controller holds at 0, the arm is measured a little beside it.
    let (mut before, mut fastest) = (0.0, 0.0f64);
    for k in 1..=400u64 {
        stream.take(&setpoint(k, 0.002, 0.0), &JointVector::new([0.001; MAX_DOF]));
        if k % 20 == 0 {
            stream.message((1000 + k) * MS).iter().for_each(|m| controller.take(m));
        }
        let [q, _] = controller.at((1000 + k) * MS);
        fastest = fastest.max((q - before).abs() / 1e-3);
        before = q;
    }
    assert!((before - 0.002).abs() < 1e-3, "{before}");
    assert!(fastest < 0.1, "{fastest} rad/s");
}

#[test]
fn missed_deadlines_are_no_jump() {
    for missed in [0, 1, 5, 20] {
        let mut stream = Stream::new(rules());
        let mut controller = Controller { segments: Vec::new() };
        let (mut deadline, mut q, mut speed) = (1000 * MS, 0.005, 0.0);
        let mut steepest: f64 = 0.0;
        let mut before = [0.0; 2];
        for k in 1..=4000u64 {
            // It speeds up to 0.5 rad/s at 1 rad/s², and the executor stalls every 0.4 s.
            let stall = if k % 400 == 0 { missed } else { 0 };
            for _ in 0..=stall {
                deadline += MS;
                if deadline % (20 * MS) == 0 {
                    stream.message(deadline).iter().for_each(|m| controller.take(m));
                }
                let at = controller.at(deadline);
                steepest = steepest.max((at[1] - before[1]).abs() / 1e-3);
                before = at;
            }
            if k > 700 {
                speed = f64::min(speed + 1e-3, 0.5);
                q += speed * 1e-3;
            }
            let mut s = setpoint(k, q, speed);
            s.deadline_ns = deadline + MS;
            // The arm stands a little beside the first setpoint.
            stream.take(&s, &JointVector::ZERO);
        }
        assert_eq!(stream.late, 0);
        assert!((q - before[0]).abs() < 0.05 && (before[1] - 0.5).abs() < 0.2, "{before:?}");
        assert!(steepest < 2.5, "{missed} missed: {steepest} rad/s²");
    }
}

#[test]
fn what_came_too_late_is_told_until_it_follows_again() {
    let mut stream = Stream::new(rules());
    let mut measured = JointVector::ZERO;
    for k in 1..=20 {
        stream.take(&setpoint(k, 1e-3 * k as f64, 1.0), &measured);
    }
    let message = stream.message(1020 * MS).expect("one");
    let rest_ns = message.start_ns + message.points.last().expect("one").after_ns;
    stream.take(&setpoint(21, 0.021, 1.0), &measured);
    assert_eq!(stream.message(1090 * MS), None);
    assert!(stream.late == 1 && stream.stopped(1021 * MS) == Some(Stop::Late));
    // The executor follows the arm, which has not come to rest: not yet.
    measured[0] = 0.1;
    stream.take(&setpoint(100, 0.1, 0.0), &measured);
    assert!(!stream.follows() && stream.stopped(1100 * MS).is_some());
    let k = (rest_ns - 60 * MS) / MS - 1000 + 1;
    stream.take(&setpoint(k, 0.14, 0.0), &JointVector::new([0.14; MAX_DOF]));
    assert!(!stream.follows(), "the other joints are far");
    measured[0] = 0.14;
    stream.take(&setpoint(k + 1, 0.14, 0.0), &measured);
    assert!(stream.follows() && stream.stopped((1001 + k) * MS).is_none());
}

#[test]
fn standing_still_sends_one_message_and_ceasing_lets_go() {
    let mut stream = Stream::new(rules());
    let mut count = 0;
    for k in 1..=100u64 {
        stream.take(&setpoint(k, 0.0, 0.0), &JointVector::ZERO);
        if k % 20 == 0 {
            count += usize::from(stream.message(1000 * MS + k * MS).is_some());
        }
    }
    assert_eq!(count, 1);
    assert!(stream.stopped(1120 * MS).is_none() && stream.follows());
    assert!(stream.stopped(1121 * MS) == Some(Stop::Ceased) && !stream.follows());
}

/// An arm whose driver tells the angle of a joint that turns without end as another one than the
/// setpoints': they are followed where the arm is, not a whole turn away.
#[test]
fn whole_turns_are_no_way_to_go() {
    for (joint, begins) in [(4, true), (6, true), (0, false)] {
        let mut stream = Stream::new(rules());
        let mut measured = JointVector::ZERO;
        measured[joint] = -3.0 * core::f64::consts::TAU + 0.01;
        for k in 1..=20u64 {
            let mut s = setpoint(k, 0.0, 0.0);
            s.positions[joint] = 1e-3 * k as f64;
            stream.take(&s, &measured);
        }
        assert_eq!(stream.follows(), begins, "joint {joint}");
        let message = stream.message(1020 * MS);
        assert_eq!(message.is_some(), begins, "joint {joint}");
        for point in message.iter().flat_map(|m| &m.points) {
            assert!((point.q[joint] - measured[joint]).abs() < 0.02, "joint {joint}: {point:?}");
        }
    }
}

/// Another executor's setpoints are not answered by the numbers of the one before it.
#[test]
fn another_executor_hears_nothing_of_the_first_ones_setpoints() {
    let mut stream = Stream::new(rules());
    for k in 5000..5100u64 {
        stream.take(&setpoint(k, 0.0, 0.0), &JointVector::ZERO);
    }
    assert_eq!(stream.in_force(6170 * MS).map(|(sequence, _)| sequence), Some(5099));
    let mut first = setpoint(1, 0.0, 0.0);
    first.deadline_ns = 6200 * MS;
    stream.take(&first, &JointVector::ZERO);
    assert_eq!(stream.in_force(6210 * MS), None, "none of its own is in force yet");
    assert_eq!(stream.in_force(6270 * MS).map(|(sequence, _)| sequence), Some(1));
}

/// A controller that leaves a message when the next one comes: from where it is to the first point.
#[derive(Default)]
struct Jtc {
    /// Time, position and velocity.
    points: Vec<(u64, [f64; 2])>,
}

impl Jtc {
    fn at(&self, now: u64) -> [f64; 2] {
        let next = self.points.iter().position(|p| p.0 > now);
        match next {
            None => self.points.last().map_or([0.0; 2], |p| [p.1[0], 0.0]),
            Some(0) => self.points[0].1,
            Some(next) => {
                let ((t0, from), (t1, to)) = (self.points[next - 1], self.points[next]);
                Controller { segments: vec![(t0, t1, [from, to])] }.at(now)
            }
        }
    }

    fn take(&mut self, message: &Message, now: u64) {
        let from = (now, self.at(now));
        let later = message.points.iter().filter_map(|p| {
            let at = message.start_ns + p.after_ns;
            (at > now).then_some((at, [p.q[0], p.v[0]]))
        });
        self.points = std::iter::once(from).chain(later).collect();
    }
}

/// Whenever messages come, within the delay, and though some never do, such a controller goes on as
/// it did: what lies ahead is in each of them.
#[test]
fn a_controller_that_splices_on_arrival_goes_on_as_it_did() {
    for (latency, lost) in [(0, 0), (3, 0), (4, 3), (12, 2), (25, 0)] {
        let mut stream = Stream::new(Rules { takeover: Takeover::AtArrival, ..rules() });
        let mut controller = Jtc::default();
        let (mut on_the_way, mut sent) = (VecDeque::new(), 0u64);
        let (mut before, mut steepest, mut farthest) = ([0.0; 2], 0.0f64, 0.0f64);
        for k in 1..=4000u64 {
            let now = (1000 + k) * MS;
            // Still for a second, then a sine of at most 0.5 rad/s and 1.6 rad/s².
            let t = k.saturating_sub(1000) as f64 * 1e-3;
            let place = |t: f64| 0.15 * (1.0 - (3.3 * t).cos());
            stream.take(&setpoint(k, place(t), 0.495 * (3.3 * t).sin()), &JointVector::ZERO);
            if k % 20 == 0 {
                sent += 1;
                let arrives = now + (latency + sent % 3) * MS;
                // Every so many, as many as that in a row at most one.
                let through = lost == 0 || sent % (2 * lost) != 0;
                on_the_way.extend(stream.message(now).filter(|_| through).map(|m| (arrives, m)));
            }
            while on_the_way.front().is_some_and(|(at, _)| *at <= now) {
                let (_, message) = on_the_way.pop_front().expect("one");
                controller.take(&message, now);
            }
            let at = controller.at(now);
            steepest = steepest.max((at[1] - before[1]).abs() / 1e-3);
            before = at;
            let followed = place((k.saturating_sub(1000 + 60)) as f64 * 1e-3);
            farthest = farthest.max((at[0] - followed).abs());
        }
        assert_eq!(stream.late, 0);
        assert!(steepest < 2.5, "{latency} ms, {lost} lost: {steepest} rad/s²");
        assert!(farthest < 1e-3, "{latency} ms, {lost} lost: {farthest} rad beside the way");
    }
}

/// The executor begins only with an endpoint that says what it follows, and the arm does not move
/// for it, nor sinks after its own sag.
#[test]
fn an_executor_that_waits_for_an_answer_gets_one() {
    use nullsweep_executor::Guard;
    use nullsweep_executor::cycle::{Input, Measured, State, step};
    use nullsweep_ipc_types::status;
    use nullsweep_robot::{ArmSpec, Robot, Side};

    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).expect("an arm");
    let guard = Guard { stale_ns: 50 * MS, lost_ns: 200 * MS, ..Guard::new(arm.limits()) };
    let (mut state, mut stream) = (State::default(), Stream::new(rules()));
    let mut controller = Controller { segments: Vec::new() };
    let (mut began, mut home) = (None, arm.home());
    home[0] = -0.003;
    for k in 1..=3000u64 {
        let now = (1000 + k) * MS;
        // The arm hangs 3 mrad below what its controller aims at.
        let mut q = home;
        q[0] = controller.at(now)[0] - 0.003;
        let measured = (k % 10 == 0).then(|| Measured {
            stamp_ns: now,
            setpoint_sequence: stream.in_force(now).map_or(0, |(sequence, _)| sequence),
            joint_count: DOF,
            q,
            status: status::CALIBRATED,
        });
        let out = step(&mut state, Input { measured, ..Input::default() }, now, &guard);
        if let Some(target) = out.setpoint {
            let mut s = setpoint(target.sequence, 0.0, 0.0);
            (s.deadline_ns, s.mode) = (now + MS, target.mode.wire());
            s.positions[..8].copy_from_slice(&target.q[..]);
            stream.take(&s, &q);
        }
        if k % 20 == 0 {
            stream.message(now).iter().for_each(|m| controller.take(m));
        }
        if state.snapshot().mode == Mode::Hold {
            began.get_or_insert(k);
        }
    }
    assert!(began.is_some_and(|k| k < 300), "holds after {began:?} cycles");
    let sunk = controller.at(4000 * MS)[0];
    assert!(sunk.abs() < 0.0035, "the arm sank by {sunk} rad");
}
