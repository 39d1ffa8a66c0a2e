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
