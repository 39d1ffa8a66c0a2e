//! Endpoints whose states do not say truly which setpoint was in force.

use super::*;

type Lie = fn(&Sim) -> u64;

const LIES: [(&str, Lie); 5] = [
    ("none", |_| 0),
    ("stuck", |_| 1),
    ("never sent", |s| s.state.sequence() + 1_000_000),
    ("the greatest", |_| u64::MAX),
    // Once each 300 cycles it is right, and then too old for as long.
    ("late", |s| s.state.sequence() / 300 * 300),
];

/// Whether the arm follows all the same or stands: no plan is finished by such an endpoint, the
/// motion ends in time, and when it answers again the command is where the arm is.
#[test]
fn an_endpoint_that_answers_wrong_is_at_fault() {
    for (name, lie) in LIES {
        for mode in [Mode::Hold, Mode::Executing, Mode::Paused, Mode::Stopping] {
            for follows in [true, false] {
                let name = format!("{name} in {mode}, the arm follows: {follows}");
                let mut sim = in_mode(mode);
                let stood = sim.arm;
                let began = sim.last.unwrap();
                for cycle in 0..700 {
                    let q = if follows { sim.arm } else { stood };
                    let told = lie(&sim);
                    let m = Measured { setpoint_sequence: told, q, ..sim.measured() };
                    sim.tick_with(Some(m), None, None);
                    let gone = (sim.last.unwrap()[0] - began[0]).abs();
                    assert!(follows || gone < 0.35, "{name}: {gone} rad after {cycle} cycles");
                }
                let Some(fault) = Some(sim.state.snapshot().fault).filter(|f| *f != Fault::None)
                else {
                    panic!("{name}: no fault");
                };
                assert_eq!(fault, Fault::Answer, "{name}");
                assert_eq!(sim.mode(), Mode::Fault, "{name}");
                if mode != Mode::Hold {
                    assert_eq!(sim.story(1), [Accepted, Started, Aborted], "{name}");
                }
                if !follows {
                    let apart = (sim.last.unwrap()[0] - stood[0]).abs();
                    assert!(apart <= 0.01 + 1e-9, "{name}: begun again, it would jump by {apart}");
                }
                assert_eq!(sim.order(Order::Reset).verdict, Verdict::Accepted, "{name}");
                sim.run(300);
                assert_eq!(sim.mode(), Mode::Hold, "{name}");
                assert_eq!(sim.state.snapshot().fault, Fault::None, "{name}");
            }
        }
    }
}

/// Before it begins, too: nothing is executed for an endpoint that answers nothing.
#[test]
fn an_endpoint_that_does_not_answer_is_not_begun_with() {
    for (name, lie) in LIES.into_iter().filter(|(name, _)| !matches!(*name, "stuck" | "late")) {
        let mut sim = Sim::new(pr2());
        for _ in 0..300 {
            let m = Measured { setpoint_sequence: lie(&sim), ..sim.measured() };
            sim.tick_with(Some(m), None, None);
            assert_eq!(sim.mode(), Mode::Init, "{name}");
        }
        assert_eq!(sim.state.snapshot().fault, Fault::Answer, "{name}");
        sim.run(5);
        assert_eq!((sim.mode(), sim.state.snapshot().fault), (Mode::Hold, Fault::None), "{name}");
    }
}

/// A wrong answer now and then is no fault, nor is a delay that is known.
#[test]
fn an_answer_may_be_missing_for_a_while() {
    let mut sim = in_mode(Mode::Executing);
    for cycle in 0..800u64 {
        let told = if cycle % 60 == 0 { sim.measured().setpoint_sequence } else { 0 };
        let m = Measured { setpoint_sequence: told, ..sim.measured() };
        sim.tick_with(Some(m), None, None);
    }
    assert_eq!(sim.story(1), [Accepted, Started, Finished]);
    assert_eq!(sim.mode(), Mode::Hold);
}

/// Without an answer the arm is still looked at: one that is farther away than the time since the
/// last answer can explain is a following error, also at rest.
#[test]
fn an_unanswered_arm_that_is_far_away_is_a_following_error() {
    let mut sim = in_mode(Mode::Hold);
    for _ in 0..90 {
        let q = moved(sim.arm, 2, 0.4);
        let m = Measured { setpoint_sequence: 0, q, ..sim.measured() };
        sim.tick_with(Some(m), None, None);
    }
    let snapshot = sim.state.snapshot();
    assert_eq!((snapshot.mode, snapshot.fault), (Mode::Fault, Fault::FollowingError));
}
