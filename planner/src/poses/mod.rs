//! Tool poses that are given, not found on a scan: how they are read, how exactly each is to be met,
//! the joint vectors that meet one, the straight way of the tool between two, and a plan through them.
//!
//! [`task`](crate::task) looks for their order, [`follow`](crate::follow) keeps it.

mod along;
mod assemble;
mod between;
mod chain;
mod floor;
mod read;
mod setup;
mod space;
mod start;
mod tolerance;
mod unmet;

pub(crate) use along::Along;
pub(crate) use assemble::{Given, Piece, Stop, assemble};
pub(crate) use chain::{Chain, Order, chain};
pub use floor::{floor_under, tip_tool};
pub use read::{Poses, PosesError, QuaternionOrder, ReadOptions, read};
pub(crate) use setup::Standing;
pub use setup::{Setup, SetupError};
pub(crate) use space::{Point, Space};
pub use tolerance::Tolerance;
pub(crate) use unmet::{Unmet, by_reason, tell_left};
