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
//! - Each of them against the points around it and the obstacles, with [`Margins::environment`].
//! - What does not move with the arm against the environment, once: [`World::stance_hit`].
//! - Of two arms that move at the same time what moves with the one against what moves with the other,
//!   with [`Margins::self_clearance`]: [`Arms`] by proofs over boxes of joint vectors, [`ExactArms`]
//!   exactly.
//!
//! # What is around the robot
//! [`Points`] are of three kinds: of the surface, raw measurements, and the border of what no view
//! has seen. The rules below say where they differ. Some of them may be to keep out of.
//!
//! # The contact rule
//! With [`ToolContact::Allowed`] the pad may touch. Its *prism* is the pad's rectangle grown by
//! [`Margins::contact_growth`] on all four sides, from [`Margins::contact_front`] before the pad's
//! plane to the tool's `press_max` behind it: so far the pad's soft body gives way.
//! - The pad is never in collision with a point in the prism. From those outside it keeps the
//!   smaller of [`Margins::environment`] and `contact_growth`. Raw measurements do not count: their
//!   noise is not the shape that presses, and what it hides is the surface's.
//! - A rigid shape that does not move against the tip (palm, fingers: they hold the sponge and end
//!   only 11 mm behind its plane on the PR2) keeps the smaller of [`Margins::environment`] and
//!   [`Margins::contact_clearance`] from every point.
//! - From points to keep out of the pad keeps its full margin ([`Margins::environment`]), or as much as
//!   it works before its plane where that is more, in the prism too.
//! - Every other shape keeps its full margin.
//!
//! A tool that works from afar (a nozzle, a camera) touches nothing: the rule gives it no leave, and
//! with [`ToolContact::Allowed`] it keeps from points to keep out of as far as it works.
//!
//! Obstacles are never contact.

mod across;
mod arms;
mod bodies;
mod check;
mod clearance;
mod error;
mod exact;
mod exact_arms;
mod field;
mod figure;
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
mod points;
mod proof;
mod rules;
mod scene;
mod shapes;
mod sieve;
mod sight;
mod solid;
mod spheres;
mod srdf;
#[cfg(test)]
mod tests;
mod tree;
mod world;

pub use arms::{Arms, Span};
pub use clearance::Clearance;
pub use error::CollisionError;
pub use exact::Exact;
pub use exact_arms::ExactArms;
pub use figure::{Figure, FigureBody, FigureShape, Triangles};
pub use mesh::{MeshError, MeshPaths};
pub use obstacle::{Obstacle, ObstacleShape};
pub use options::{Attached, Options};
pub use pairs::{Excluded, Reason};
pub use points::Points;
pub use rules::{Hit, Margins, ToolContact, With};
pub use sight::Solids;
pub use srdf::{GroupState, SrdfError, group_states};
pub use world::World;
