//! Every order and every offer in every mode.

use super::*;

/// Every order in every mode: the answer, and the mode some cycles later.
#[test]
fn orders_in_every_mode() {
    use Verdict::{Accepted as Yes, StillFaulty, WrongMode as No};
    let orders = [
        Order::Status,
        Order::Pause,
        Order::Resume,
        Order::Stop,
        Order::StopAndDisable,
        Order::Speed(0.3),
        Order::Reset,
        Order::Shutdown,
    ];
    let table = [
        (Mode::Init, [Yes, No, No, Yes, Yes, Yes, Yes, Yes]),
        (Mode::Hold, [Yes, No, No, Yes, Yes, Yes, Yes, Yes]),
        (Mode::Executing, [Yes, Yes, Yes, Yes, Yes, Yes, No, Yes]),
        (Mode::Paused, [Yes, Yes, Yes, Yes, Yes, Yes, No, Yes]),
        (Mode::Stopping, [Yes, No, No, Yes, Yes, Yes, No, Yes]),
        (Mode::Fault, [Yes, No, No, Yes, Yes, Yes, StillFaulty, Yes]),
    ];
    for (mode, verdicts) in table {
        for (order, verdict) in orders.into_iter().zip(verdicts) {
            let mut sim = in_mode(mode);
            assert_eq!(sim.order(order).verdict, verdict, "{order:?} in {mode}");
            sim.run(1200);
            let life = sim.lives.get(&id(1)).copied().unwrap_or_default();
            let open = matches!(order, Order::Pause)
                || (mode == Mode::Paused
                    && !matches!(order, Order::Resume)
                    && verdict == Yes
                    && matches!(order, Order::Status | Order::Speed(_)))
                || (mode == Mode::Paused && matches!(order, Order::Reset));
            if !open {
                assert_eq!(life.ended, life.accepted, "{order:?} in {mode}");
            }
        }
    }
}

/// Every plan in every mode: accepted or rejected, never both, and the arm never jumps (`Sim`
/// judges that).
#[test]
fn offers_in_every_mode() {
    for mode in Mode::ALL {
        for rule in JoinRule::ALL {
            let mut sim = in_mode(*mode);
            let guard = sim.guard;
            let from = sim.last.unwrap_or(HOME);
            let offer = match rule {
                JoinRule::AtKnot => joining(&guard, 9, &line(from), id(1), 8),
                rule => plan(&guard, 9, *rule, &line(from)),
            };
            let events = sim.offer(offer);
            let mine: Vec<_> = events.iter().filter(|e| e.plan == id(9)).collect();
            let ready = matches!(mode, Mode::Hold | Mode::Paused);
            let fits = match rule {
                JoinRule::StopThenStart => ready,
                JoinRule::AfterCurrent => *mode == Mode::Hold,
                JoinRule::AtKnot => false,
            };
            assert_eq!(mine[0].kind == Accepted, fits, "{rule} in {mode}: {mine:?}");
            sim.order(Order::Stop);
            sim.run(500);
            for (plan, life) in &sim.lives {
                assert_eq!(life.ended, life.accepted, "{plan} after {rule} in {mode}");
            }
        }
    }
}

/// What an operator may do in any mode, but for ending the executor.
const ORDERS: [Order; 7] = [
    Order::Status,
    Order::Pause,
    Order::Resume,
    Order::Stop,
    Order::StopAndDisable,
    Order::Speed(0.0),
    Order::Reset,
];

/// What then happens to the endpoint, for a while.
const TROUBLES: [(&str, bool, u32); 4] = [
    ("nothing", true, 0),
    ("silence", false, 0),
    ("error", true, status::ERROR),
    ("halt", true, status::HALTED),
];

/// From every mode, after any two orders and whatever trouble that is over, the same few commands
/// lead to where a plan is taken and finished. The endpoint is halted while its motors are asked
/// off.
#[test]
fn every_state_has_a_way_out_by_commands() {
    for mode in Mode::ALL {
        for (first, second) in ORDERS.iter().flat_map(|a| ORDERS.iter().map(move |b| (a, b))) {
            for (trouble, speaks, bits) in TROUBLES {
                let mut sim = in_mode(*mode);
                sim.order(*first);
                sim.run(150);
                sim.order(*second);
                sim.run(20);
                let before = sim.status;
                (sim.speaks, sim.status) = (speaks, before | bits);
                sim.run(150);
                (sim.speaks, sim.status) = (true, status::CALIBRATED);
                sim.run(50);
                let what = format!("{first:?}, {second:?} in {mode}, then {trouble}");
                for order in [Order::Reset, Order::Resume, Order::Speed(1.0), Order::Stop] {
                    sim.order(order);
                    sim.run(200);
                }
                let after = sim.state.snapshot();
                assert_eq!(after.mode, Mode::Hold, "{what}: {}", after.fault);
                assert!(!sim.off, "{what}: the motors are on");
                let held = sim.last.unwrap();
                let offer = plan(&sim.guard, 99, JoinRule::StopThenStart, &line(held));
                only(&sim.offer(offer), Accepted);
                sim.run_until(Mode::Hold, 500);
                assert_eq!(sim.story(99), [Accepted, Started, Finished], "{what}");
            }
        }
    }
}

/// The case that was seen: the arm stands faulted, the operator takes the motors off to be safe, and
/// then goes on.
#[test]
fn motors_taken_off_after_a_fault_come_on_again_with_a_reset() {
    let mut sim = in_mode(Mode::Fault);
    sim.status = status::CALIBRATED;
    assert_eq!(sim.order(Order::StopAndDisable).verdict, Verdict::Accepted);
    sim.run(10);
    assert!(sim.off);
    // What it was not asked to is still a cause.
    sim.status |= status::ERROR;
    sim.run(2);
    assert_eq!(sim.order(Order::Reset).verdict, Verdict::StillFaulty);
    sim.status = status::CALIBRATED;
    sim.run(2);
    assert_eq!(sim.order(Order::Reset).verdict, Verdict::Accepted);
    sim.run(5);
    assert_eq!((sim.mode(), sim.off), (Mode::Hold, false));
}
