//! A robot in its surroundings, prepared for fast collision checks.

use std::sync::Arc;

use nullsweep_robot::{Arm, JointVector, Robot, Tool};

use crate::bodies::Bodies;
use crate::error::CollisionError;
use crate::exact::Exact;
use crate::field::Field;
use crate::fixed::Fixed;
use crate::frame::Frame;
use crate::motion::Reach;
use crate::moving::{Contact, Moving, Touch};
use crate::never::{self, Placed, Ranges, never_near};
use crate::obstacle::Obstacle;
use crate::options::Options;
use crate::pairs::Excluded;
use crate::points::Points;
use crate::rules::{Hit, Margins};
use crate::scene::Scene;
use crate::solid::Solid;

/// The robot at one stance with its tool, scan and obstacles: immutable, shared between threads.
///
/// What its fast check passes, the exact one ([`Exact`]) passes too. It refuses more: what is within
/// about 10⁻⁸ m of a margin, and joints farther beyond their limits than its proofs reach (0.35 rad).
pub struct World {
    pub(crate) bodies: Bodies,
    /// Shapes that move with the arm: links, held objects, the pad.
    pub(crate) moving: Vec<Moving>,
    /// Shapes that do not, and the obstacles.
    pub(crate) fixed: Vec<Fixed>,
    /// Pairs of moving shapes to check.
    pub(crate) pairs: Vec<(usize, usize)>,
    /// All points.
    pub(crate) field: Arc<Field>,
    /// Those that press on the pad.
    pub(crate) firm: Arc<Field>,
    /// Those that not even the pad may touch, and what it keeps from them. \[m\]
    pub(crate) keep_out: (Field, f64),
    pub(crate) reach: Reach,
    pub(crate) margins: Margins,
    pub(crate) contact: Contact,
    /// Where each joint may be asked about: beyond, dropped scan points may be in reach and dropped
    /// pairs near each other. \[rad\] or \[m\]
    pub(crate) ranges: Ranges,
    exact: Exact,
}

/// The shapes of a scene, by whether they move, and the pairs of moving ones to check.
struct Sorted {
    moving: Vec<Moving>,
    fixed: Vec<Fixed>,
    pairs: Vec<(usize, usize)>,
}

impl World {
    /// Prepares the checks of an arm with a tool among points and obstacles, both in the robot's root
    /// frame.
    ///
    /// # Errors
    /// When a mesh or the SRDF cannot be used, a link is unknown, a margin or a scan point is not a
    /// proper number, or the arm drives too many joints; see [`CollisionError`].
    pub fn new<'a>(
        robot: &Robot,
        arm: &Arm,
        tool: &Tool,
        points: impl Into<Points<'a>>,
        obstacles: &[Obstacle],
        options: &Options,
    ) -> Result<Self, CollisionError> {
        let (scene, bodies) = Scene::prepare(robot, arm, tool, &points.into(), obstacles, options)?;
        let margins = options.margins;
        let contact = Contact::new(&bodies, tool, &margins);
        let Sorted { mut moving, fixed, mut pairs } = sort(&scene, &bodies, &contact);
        let reach = Reach::new(&bodies, arm, &moving);
        let within = reach.radius + margins.environment;
        let near = |points: &[_]| Arc::new(Field::new(points, &reach.centre, within));
        let (all, firm) = (&scene.points.points, scene.points.firm());
        let field = near(all);
        let firm = if firm.len() == all.len() { Arc::clone(&field) } else { near(firm) };
        let apart = margins.of_keep_out(tool);
        let keep_out = &scene.points.keep_out;
        let keep_out = (Field::new(keep_out, &reach.centre, reach.radius + apart), apart);
        let ranges = never::ranges(arm, &reach.stroke);
        leave_out(&bodies, &ranges, &mut moving, &fixed, &mut pairs, &margins);
        let exact = Exact::over(arm.clone(), scene);
        Ok(Self {
            bodies,
            moving,
            fixed,
            pairs,
            field,
            firm,
            keep_out,
            reach,
            margins,
            contact,
            ranges,
            exact,
        })
    }

    /// The link pairs that are not checked, and why; links rigid to each other are not listed.
    #[must_use]
    pub fn excluded(&self) -> &[Excluded] {
        &self.exact.scene().pairs.excluded
    }

    /// What was made up while building, in words: capsules in place of missing meshes.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.exact.scene().notes
    }

    /// The first link that does not move with the arm (base, torso, other arm) and is too near to
    /// a point or to an obstacle that does not carry the robot. Slow: once per stance.
    #[must_use]
    pub fn stance_hit(&self) -> Option<Hit> {
        self.exact.stance_hit()
    }

    /// Whether every joint is where it may be asked about; NaN is not.
    #[inline]
    pub(crate) fn is_in_range(&self, q: &JointVector) -> bool {
        let inside = |(value, (low, high)): (&f64, &(f64, f64))| {
            value.is_finite() && low <= value && value <= high
        };
        q.iter().zip(&self.ranges).all(inside)
    }

    /// The exact check of the same scene: slow, and independent of the fast one.
    #[must_use]
    pub fn exact(&self) -> &Exact {
        &self.exact
    }
}

/// Sorts the scene's parts into moving and fixed shapes, obstacles last.
fn sort(scene: &Scene, bodies: &Bodies, contact: &Contact) -> Sorted {
    let margins = &scene.margins;
    let (mut moving, mut fixed) = (Vec::new(), Vec::new());
    // For each part: its body, and its index among the moving or the fixed shapes.
    let mut slots = Vec::new();
    for part in &scene.parts {
        let (body, carrier) = bodies.carrier(part.link);
        let place = carrier.then(&Frame::from(&part.origin));
        match body {
            Some(body) => {
                slots.push((Some(body), moving.len()));
                let at_tip = body == bodies.tip_body;
                let touch = at_tip.then(|| Touch::new(part, &place, contact, margins)).flatten();
                moving.push(Moving::new(part, body, place, touch));
            }
            None => {
                slots.push((None, fixed.len()));
                fixed.push(Fixed::new(&part.solid, &part.shape, place, margins.self_clearance));
            }
        }
    }
    let mut pairs = Vec::new();
    for &(a, b) in &scene.pairs.checked {
        match (slots[a], slots[b]) {
            ((Some(_), a), (Some(_), b)) => pairs.push((a, b)),
            ((Some(_), a), (None, b)) => moving[a].against.push(b),
            ((None, a), (_, b)) => moving[b].against.push(a),
        }
    }
    pairs.sort_by_key(|&(a, b): &(usize, usize)| (moving[a].body, moving[b].body));
    for (index, obstacle) in scene.obstacles.iter().enumerate() {
        for (part, slot) in slots.iter().enumerate() {
            if let (Some(_), shape) = *slot
                && !scene.grounded.contains(&(part, index))
            {
                moving[shape].against.push(fixed.len());
            }
        }
        let place = Frame::from(&obstacle.pose);
        fixed.push(Fixed::new(&obstacle.solid, &obstacle.shape, place, margins.environment));
    }
    Sorted { moving, fixed, pairs }
}

/// Drops the pairs of the robot's shapes that are proven never to come near each other.
fn leave_out(
    bodies: &Bodies,
    ranges: &Ranges,
    moving: &mut [Moving],
    fixed: &[Fixed],
    pairs: &mut Vec<(usize, usize)>,
    margins: &Margins,
) {
    let need = margins.self_clearance;
    let never = |a: &Moving, body: Option<usize>, place: &Frame, solid: &Solid| {
        let own = Placed { body: Some(a.body), place: &a.place, solid: &a.solid };
        never_near(bodies, ranges, own, Placed { body, place, solid }, need)
    };
    pairs.retain(|&(a, b)| {
        let b = &moving[b];
        !never(&moving[a], Some(b.body), &b.place, &b.solid)
    });
    for k in 0..moving.len() {
        let mut against = std::mem::take(&mut moving[k].against);
        against.retain(|&f| !never(&moving[k], None, &fixed[f].place, &fixed[f].solid));
        moving[k].against = against;
    }
}

impl std::fmt::Debug for World {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("World")
            .field("moving", &self.moving.len())
            .field("fixed", &self.fixed.len())
            .field("pairs", &self.pairs.len())
            .field("points", &self.field.len())
            .finish_non_exhaustive()
    }
}
