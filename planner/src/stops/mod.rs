//! The whole object: where the robot stops so that both arms together sweep all that any stop could.
//!
//! A [`Survey`] says what each of many places on the floor reaches, by an exact look. A few of them are
//! chosen by a weighted set cover ([`cover`](crate::cover)), what they reach is shared out among them and
//! their arms ([`Share`]), each share is planned by itself ([`work`]), or two arms' shares so that both work at
//! once ([`coordinate`](crate::coordinate)), and what no plan has swept is chosen for again, until no stop is
//! worth it ([`Rounds`]).

mod choice;
mod drive;
mod error;
mod floor;
mod look;
mod pair;
mod program;
mod rest;
mod rounds;
mod run;
mod setup;
mod share;
mod survey;
mod tolerance;
mod unswept;

pub use choice::Stop;
pub use error::StopsError;
pub use program::program;
pub use rest::{LeftOff, Rest, RestError, rest};
pub use rounds::{Rounds, State};
pub use run::run;
pub use setup::{Setup, lifts};
pub use share::{Share, Worked, work};
pub use survey::{Site, Survey, survey};
pub use tolerance::Offset;
