//! What happens around the loop, cycle by cycle, written as bytes.

use nullsweep_executor::cycle::Order;

/// One thing that happens, after some cycles in which nothing does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Deed {
    /// Somebody orders something.
    Order(Order),
    /// The next plan is offered.
    Offer,
    /// The endpoint falls silent, or speaks again.
    Silence,
    /// The endpoint's status bits change: these flip.
    Status(u32),
    /// The endpoint measures this once, in joint 0. \[rad\]
    Measured(f64),
    /// Something pushes the arm: joint 0 is off by this from now on. \[rad\]
    Pushed(f64),
    /// So many deadlines are missed.
    Missed(u32),
    /// A state comes whose stamp is this much off. \[ns\]
    Stamp(i64),
}

/// A deed of two bytes: what, and how much.
pub(crate) fn deed([what, amount]: [u8; 2]) -> Deed {
    let share = f64::from(amount) / 255.0;
    match what % 16 {
        0 => Deed::Order(Order::Pause),
        1 => Deed::Order(Order::Resume),
        2 => Deed::Order(Order::Stop),
        3 => Deed::Order(Order::StopAndDisable),
        4 => Deed::Order(Order::Speed(if amount == 255 { f64::NAN } else { 2.0 * share - 0.5 })),
        5 => Deed::Order(Order::Reset),
        6 => Deed::Order(Order::Shutdown),
        7 => Deed::Order(Order::Status),
        8 => Deed::Silence,
        9 => Deed::Status(1 << (amount % 32)),
        10 => Deed::Measured([f64::NAN, f64::INFINITY, 1e300, -7.0][usize::from(amount % 4)]),
        11 => Deed::Pushed(0.2 * share - 0.1),
        12 => Deed::Missed(u32::from(amount).pow(2)),
        13 => Deed::Stamp((i64::from(amount) - 128).pow(3) * 1_000_000),
        _ => Deed::Offer,
    }
}
