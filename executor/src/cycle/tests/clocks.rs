//! Stamps that are not of the loop's clock.

use super::*;

const HOUR: u64 = 3_600_000 * MS;
/// What CLOCK_REALTIME shows when CLOCK_MONOTONIC shows little.
const EPOCH: u64 = 1_764_000_000_000 * MS;

fn stamped(sim: &mut Sim, stamp: impl Fn(u64) -> u64) {
    let stamp_ns = stamp(sim.now + sim.guard.period_ns);
    let m = Measured { stamp_ns, ..sim.measured() };
    sim.tick_stamped(Some(m), None, None);
}

/// One stamp of an hour ahead is refused and told, and keeps no later state out.
#[test]
fn one_stamp_from_the_future_is_refused_and_told() {
    for ahead in [6 * MS, HOUR, EPOCH, u64::MAX] {
        for mode in [Mode::Hold, Mode::Executing, Mode::Paused, Mode::Stopping] {
            let mut sim = in_mode(mode);
            stamped(&mut sim, |now| now.saturating_add(ahead));
            let refused = sim.state.snapshot().refused;
            assert_eq!((refused.count, refused.at_ns), (1, sim.now), "{ahead} in {mode}");
            assert!(refused.ahead_ns >= 6 * MS as i64, "{refused:?}");
            sim.run(60);
            assert_ne!(sim.mode(), Mode::Fault, "{ahead} in {mode}");
            let refused = sim.state.snapshot().refused;
            assert_eq!((refused.count, refused.at_ns), (1, 0), "a good one has come since");
            sim.order(Order::Resume);
            sim.run_until(Mode::Hold, 1000);
            assert_eq!(sim.state.snapshot().fault, Fault::None, "{ahead} in {mode}");
        }
    }
}

/// An endpoint with another clock is recognised: when it begins, and when it comes to that.
#[test]
fn another_clock_is_a_fault_of_its_own() {
    type Stamp = fn(u64) -> u64;
    let clocks: [(&str, Stamp); 3] =
        [("an hour ahead", |n| n + HOUR), ("realtime", |n| n + EPOCH), ("behind", |n| n - HOUR)];
    for (name, stamp) in clocks {
        let mut sim = Sim::new(pr2());
        sim.now = 2 * HOUR;
        for _ in 0..50 {
            stamped(&mut sim, stamp);
            assert_eq!((sim.mode(), sim.last), (Mode::Init, None), "{name}");
        }
        let snapshot = sim.state.snapshot();
        assert_eq!((snapshot.fault, snapshot.refused.count), (Fault::Clock, 50), "{name}");
        assert_eq!(snapshot.refused.ahead_ns > 0, name != "behind", "{name}");
        sim.run(5);
        assert_eq!((sim.mode(), sim.state.snapshot().fault), (Mode::Hold, Fault::None), "{name}");
    }
    for (name, stamp) in &clocks[..2] {
        for mode in [Mode::Hold, Mode::Executing, Mode::Paused, Mode::Stopping] {
            let mut sim = in_mode(mode);
            for _ in 0..400 {
                stamped(&mut sim, stamp);
            }
            let snapshot = sim.state.snapshot();
            assert_eq!((snapshot.mode, snapshot.fault), (Mode::Fault, Fault::Clock), "{name}");
            if mode != Mode::Hold {
                assert_eq!(sim.story(1), [Accepted, Started, Aborted], "{name} in {mode}");
            }
            assert_eq!(sim.order(Order::Reset).verdict, Verdict::Accepted, "{name} in {mode}");
            sim.run(200);
            assert_eq!(sim.mode(), Mode::Hold, "{name} in {mode}");
        }
    }
}
