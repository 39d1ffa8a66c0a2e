//! Following tool paths that are given: the poses in their order, segment by segment, with the fewest
//! changes of posture and, among those, the least joint movement.
//!
//! 1. *Stations*: the given poses, and places put in between where two are far apart.
//! 2. *Layers*: at some of the stations joint vectors that meet it, sampled over all postures, the
//!    redundancy and the tolerance.
//! 3. The *ladder* through the layers: the path with the fewest reconfigurations and, among those, the
//!    least movement over all samples. Motions between layers are made when the best path asks for
//!    them, their cost beforehand being never above the truth, so the path that remains is proven.
//! 4. It is *smoothed* in the null space: each joint vector moves, its tool pose kept, where the way
//!    becomes shorter, as far as it stays free of collision.

mod config;
mod error;
mod figures;
mod labels;
mod ladder;
mod layer;
mod problem;
mod run;
mod smooth;
mod station;
mod ways;

pub use config::FollowConfig;
pub use error::FollowError;
pub use figures::FollowFigures;
pub use run::{FollowOutcome, run};
