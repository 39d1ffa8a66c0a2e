//! The joint path through the tour's poses: tracked along the surface where that goes, else lifted
//! off, through free space, and set down.

mod hub;
mod jump;
pub mod layered;
mod leg;
mod memo;
mod mover;
mod retreat;
mod rrt_connect;
#[cfg(test)]
mod tests;

pub use hub::{Hub, Spoke};
pub use jump::{back_away, jump, reconfigure};
pub use leg::Leg;
pub use memo::Memo;
pub use mover::{Mover, lift_cost};
pub use retreat::{lift, retract};
pub use rrt_connect::{Options as RrtOptions, rrt_connect};
