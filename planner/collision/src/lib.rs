//! Collision: whether a configuration, or a motion, keeps its distance from robot and environment.
//!
//! Everything is in the robot's root frame, lengths in metres, angles in radians. There are two
//! checks, each built once per stance and then asked from any number of threads:
//! - [`World`], the fast one, for the search: it proves freedom by bounds (spheres over each shape,
//!   a distance grid over the scan) and falls back to distances by GJK where bounds do not suffice.
//! - [`Exact`], the slow one, for the verification: parry's shapes, every pair and every raw point.
//!
//! # What is checked
//! - Each shape that moves with the arm (the links' own shapes, attached objects, the tool's pad)
//!   against the robot's other shapes, with [`Margins::self_clearance`]. Left out are links that
//!   are rigid to each other, links joined by a joint, and shapes that always touch, or that an
//!   SRDF disables: [`World::excluded`] lists them with the [`Reason`]. The fast check also leaves
//!   out pairs that are proven never to come near each other; a joint more than 0.35 rad beyond its
//!   limits, where no proof was made, counts as a collision there.
//! - Each of them against the scan's points and the obstacles, with [`Margins::environment`].
//! - What does not move with the arm against the environment, once: [`World::stance_hit`].
//!
//! # The contact rule
//! With [`ToolContact::Allowed`] the pad may touch the scan. Its *prism* is the pad's rectangle
//! grown by [`Margins::contact_growth`] on all four sides, from [`Margins::contact_front`] before
//! the pad's plane back to the pad's back (its thickness). Scan points in the prism are contact:
//! the sponge is compressed there. So, for a scan point in the prism,
//! - the pad is never in collision with it;
//! - a shape that is rigid to the tip (palm, fingers, fingertips: they hold the sponge and end only
//!   11 mm behind its plane on the PR2, while a depth camera's noise is ±5 mm) is in collision only
//!   if the point lies deeper than [`Margins::contact_depth`] inside of it;
//! - every other shape keeps its full margin.
//!
//! Scan points outside the prism keep the full margin from every shape that is not rigid to the
//! tip. The pad keeps the smaller of it and `contact_growth`, the other shapes that are rigid to
//! the tip the smaller of it and [`Margins::contact_clearance`]: a flat surface beside the pad,
//! 11 mm before the fingertips, is then no collision, while anything behind the pad's back still
//! is. Obstacles are never contact.

mod bodies;
mod check;
mod error;
mod exact;
mod field;
mod fixed;
mod frame;
mod mesh;
mod motion;
mod moving;
mod never;
mod obstacle;
mod options;
mod pairs;
mod parts;
mod proof;
mod rules;
mod scene;
mod shapes;
mod sieve;
mod solid;
mod spheres;
mod srdf;
#[cfg(test)]
mod tests;
mod world;

pub use error::CollisionError;
pub use exact::Exact;
pub use mesh::{MeshError, MeshPaths};
pub use obstacle::{Obstacle, ObstacleShape};
pub use options::{Attached, Options};
pub use pairs::{Excluded, Reason};
pub use rules::{Hit, Margins, ToolContact, With};
pub use srdf::{GroupState, SrdfError, group_states};
pub use world::World;
