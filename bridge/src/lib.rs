//! What endpoints have in common that give an arm's controller trajectories, not setpoints: no ROS,
//! no network, so that it is tested here once.
//!
//! Setpoints at 1 kHz become short overlapping trajectories ([`Stream`]), each followed a fixed
//! [`Playout`] delay later; a [`Player`] follows them for controllers that take bare positions.
//! Messages of joint states become the executor's states ([`Ear`]). An [`Endpoint`] is all of that
//! at the executor's side. [`Whole`] takes the executor's place and gives whole plans instead; [`front`] makes plans of trajectories that others have.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x <= bound)` is how a NaN falls on the safe side"
)]

mod ear;
mod endpoint;
mod front;
mod player;
mod playout;
mod splice;
mod stream;
mod thin;
mod wall;
mod whole;

pub use ear::{Ear, Heard, HeardError};
pub use endpoint::{Do, Endpoint, Health, Timing};
pub use front::{Front, FrontError, Waypoint, front};
pub use player::Player;
pub use playout::Playout;
pub use stream::{Message, Point, Rules, Stop, Stream, Takeover};
pub use thin::thin;
pub use wall::{moment, wall_time};
pub use whole::{Ask, Goal, Whole, fit};
