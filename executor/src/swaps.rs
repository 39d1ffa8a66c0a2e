//! Swaps at random moments, in virtual time: whatever is published, ordered or broken, the
//! commanded position never jumps and every plan has one admission and, once accepted, one end.

use std::sync::Arc;

use nullsweep_ipc_types::{JoinRule, Mode, PlanId, status};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::cycle::Order;
use crate::guard::tests::pr2;
use crate::testing::{HOME, MS, Sim, cubic, joining, plan};
use crate::{Guard, JointVector, ValidPlan, total};

/// Swaps of the short form, and of the long one that is run by hand.
const SHORT: u32 = 20_000;
const LONG: u32 = 1_000_000;

struct Dice(ChaCha8Rng);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn below(&mut self, n: u64) -> u64 {
        self.0.random_range(0..n)
    }

    fn unit(&mut self) -> f64 {
        self.0.random()
    }
}

/// Some knots near HOME from `from`, within limits.
fn walk(dice: &mut Dice, from: JointVector) -> Vec<(u64, JointVector)> {
    let mut points = vec![(0, from)];
    let (mut time, mut q) = (0, from);
    for _ in 0..=dice.below(12) {
        let step = 5 + dice.below(60);
        for j in 0..7 {
            // Back towards HOME on average, at most 1.2 rad/s.
            let pull = 0.2 * total::limited(HOME[j] - q[j], 1.0);
            let speed = 1.0 * (2.0 * dice.unit() - 1.0) + pull;
            q[j] += speed * step as f64 * 1e-3;
        }
        time += step * MS + dice.below(MS);
        points.push((time, q));
    }
    points
}

fn random_plan(
    dice: &mut Dice,
    sim: &Sim,
    number: u64,
    running: Option<&ValidPlan>,
) -> Arc<ValidPlan> {
    let guard: &Guard = &sim.guard;
    let commanded = sim.last.unwrap_or(HOME);
    let mut from = commanded;
    match (dice.below(4), running) {
        // Where it will be: at a knot, or at the end, of the running plan.
        (0 | 1, Some(run)) => {
            let knot = dice.below(run.knots().len() as u64) as usize;
            from = run.knots()[knot].q;
            let points = walk(dice, from);
            if dice.below(2) == 0 {
                return joining(guard, number, &points, run.id(), knot);
            }
            return plan(guard, number, JoinRule::AfterCurrent, &points);
        }
        // Somewhere else altogether.
        (2, _) => from[(dice.below(7)) as usize] += 0.1 * (dice.unit() - 0.5),
        _ => {
            for q in &mut from[..7] {
                *q += 0.03 * (dice.unit() - 0.5);
            }
        }
    }
    let points = walk(dice, from);
    if dice.below(4) == 0 {
        return cubic(guard, number, &slower(points));
    }
    let rule = if dice.below(3) == 0 { JoinRule::AfterCurrent } else { JoinRule::StopThenStart };
    plan(guard, number, rule, &points)
}

/// Twice the time, so that curves through the same points stay below every limit.
fn slower(mut points: Vec<(u64, JointVector)>) -> Vec<(u64, JointVector)> {
    for (time, _) in &mut points {
        *time *= 2;
    }
    points
}

fn swap_at_random(seed: u64, swaps: u32) -> String {
    let mut dice = Dice::new(seed);
    let mut guard = pr2();
    // Random walks of all joints are no test of the limits; `admit` has its own.
    for joint in &mut guard.joints[..guard.dof] {
        joint.limits.lower = -10.0;
        joint.limits.upper = 10.0;
        joint.limits.acceleration = 1e4;
    }
    let mut sim = Sim::holding(guard);
    let mut published: Vec<Arc<ValidPlan>> = Vec::new();
    let mut cycles = 0u64;
    for number in 1..=u64::from(swaps) {
        let running = sim.state.snapshot().plan;
        let run = published.iter().find(|p| p.id() == running).cloned();
        let offer = random_plan(&mut dice, &sim, number, run.as_deref());
        published.push(offer.clone());
        if published.len() > 32 {
            published.remove(0);
        }
        // A plan and an order may come in one cycle.
        let order = (dice.below(12) == 0).then(|| random_order(&mut dice));
        sim.tick(order, Some(offer));
        for _ in 0..dice.below(120) {
            let order = (dice.below(200) == 0).then(|| random_order(&mut dice));
            sim.tick(order, None);
            cycles += 1;
        }
        if dice.below(100) == 0 {
            sim.speaks = false;
            sim.run(dice.below(150) as usize);
            sim.speaks = true;
        }
        if dice.below(200) == 0 {
            sim.status = status::HALTED | status::CALIBRATED;
            sim.run(5);
            sim.status = status::CALIBRATED;
        }
        if sim.mode() == Mode::Fault {
            sim.run(400);
            sim.order(Order::Reset);
            sim.run(100);
        }
        if matches!(sim.mode(), Mode::Paused) || sim.state.snapshot().scale < 0.1 {
            sim.order(Order::Speed(1.0));
            sim.order(Order::Resume);
        }
        if matches!(sim.mode(), Mode::Hold | Mode::Init) && dice.below(4) == 0 {
            // After a disable.
            sim.order(Order::Resume);
            sim.run(20);
        }
        // Lives that are over need not be remembered; what is left must still be running.
        if number.is_multiple_of(1000) {
            sim.lives.retain(|_, life| life.ended < life.accepted);
            assert!(sim.lives.len() <= 8, "{:?}", sim.lives);
            sim.events.clear();
        }
    }
    sim.order(Order::Speed(1.0));
    sim.order(Order::Stop);
    sim.run(2000);
    for (plan, life) in &sim.lives {
        assert_eq!(life.ended, life.accepted, "{plan}: {life:?}");
        assert_eq!(life.accepted + life.rejected, 1, "{plan}: {life:?}");
    }
    assert_ne!(sim.state.snapshot().plan, PlanId { epoch: 1000, number: u64::from(swaps) });
    format!("{swaps} swaps in {cycles} cycles: {:?}", sim.tally)
}

#[test]
fn random_swaps_never_jump_and_lose_no_outcome() {
    println!("{}", swap_at_random(1, SHORT));
}

/// The laboratory's form: `cargo test --release -p nullsweep-executor -- --ignored million`.
#[test]
#[ignore = "a million swaps take minutes"]
fn a_million_random_swaps() {
    println!("{}", swap_at_random(2, LONG));
}

fn random_order(dice: &mut Dice) -> Order {
    match dice.below(8) {
        0 | 1 => Order::Pause,
        2 | 3 => Order::Resume,
        4 => Order::Speed(dice.unit()),
        5 => Order::Stop,
        6 if dice.below(4) == 0 => Order::StopAndDisable,
        _ => Order::Speed(1.0),
    }
}
