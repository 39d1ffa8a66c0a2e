//! Proofs that nothing collides along a whole joint path.
//!
//! One joint vector in the middle of a path proves much of it: whatever is there farther from
//! everything than it can move up to the path's ends needs no second look. So each thing to check
//! (a shape against the scan, a shape against what stands still, a pair of shapes) is followed by
//! itself, and only for what is left open the path is halved.

use std::collections::VecDeque;

use nalgebra::Vector3;
use nullsweep_robot::JointVector;

use crate::bodies::MAX_BODIES;
use crate::check::Check;
use crate::frame::Frame;
use crate::motion::Slack;
use crate::rules::ToolContact;
use crate::world::World;

/// The straight line between two joint vectors is halved at most this often before it counts as
/// not proven.
const HALVINGS: u32 = 7;

/// A part of a path.
#[derive(Clone, Copy, Debug)]
enum Piece {
    /// From one joint vector of the path to another.
    Knots(usize, usize),
    /// On the line from joint vector `knot` to the next, between two shares of it.
    Line { knot: usize, from: f64, to: f64, halvings: u32 },
}

impl Piece {
    /// From one joint vector of the path to another; a line if nothing is between them.
    fn between(from: usize, to: usize) -> Self {
        match to - from {
            1 => Self::Line { knot: from, from: 0.0, to: 1.0, halvings: 0 },
            _ => Self::Knots(from, to),
        }
    }

    /// The joint vector in its middle, or the one before that.
    fn middle(&self) -> usize {
        match *self {
            Self::Knots(from, to) => (from + to) / 2,
            Self::Line { knot, .. } => knot,
        }
    }
}

/// The frames of all bodies at a joint vector, and the centres of the balls about them.
struct Posture {
    poses: [Frame; MAX_BODIES],
    centres: [Vector3<f64>; MAX_BODIES],
}

/// A path that is to be proven free.
struct Proof<'a> {
    world: &'a World,
    path: &'a [JointVector],
    contact: ToolContact,
    postures: Vec<Posture>,
    /// Length that each joint travels from the path's start up to each joint vector. \[rad\] or \[m\]
    travelled: Vec<JointVector>,
    /// How far each line bends, see [`Reach::bend`](crate::motion::Reach::bend). \[m\]
    bends: Vec<[f64; MAX_BODIES]>,
}

impl World {
    /// Whether the whole straight joint line from `a` to `b` \[rad\] or \[m\] is proven free. False if
    /// a collision is found, or if no proof is found within 7 halvings (a motion that grazes a
    /// margin).
    #[must_use]
    pub fn motion_free(&self, a: &JointVector, b: &JointVector, contact: ToolContact) -> bool {
        // The end first: it is where a useless motion is most often seen to be one.
        self.is_free(b, contact) && self.unproven(&[*a, *b], contact).is_none()
    }

    /// Where along the path, straight joint lines from one joint vector to the next \[rad\] or \[m\],
    /// no proof was found: at this joint vector, or between it and the next. None: the whole path is
    /// free; see [`Self::motion_free`].
    #[must_use]
    pub fn unproven(&self, path: &[JointVector], contact: ToolContact) -> Option<usize> {
        let outside = path.iter().position(|q| !self.is_in_range(q));
        outside.or_else(|| Proof::new(self, path, contact).gap())
    }
}

impl<'a> Proof<'a> {
    fn new(world: &'a World, path: &'a [JointVector], contact: ToolContact) -> Self {
        let mut travelled = vec![JointVector::ZERO];
        let mut bends = Vec::with_capacity(path.len());
        for pair in path.windows(2) {
            let travel = pair[0].displacement(&pair[1]);
            let before = travelled[travelled.len() - 1];
            travelled.push(before + travel);
            let mut bend = [0.0; MAX_BODIES];
            for (body, bend) in bend.iter_mut().enumerate().take(world.bodies.bodies.len()) {
                *bend = world.reach.bend(body, &travel);
            }
            bends.push(bend);
        }
        let postures = path.iter().map(|q| Posture::of(world, q)).collect();
        Self { world, path, contact, postures, travelled, bends }
    }

    /// Where the path collides, or is not proven.
    fn gap(&self) -> Option<usize> {
        let last = self.path.len().checked_sub(1)?;
        // Coarse pieces first: they find a collision soonest.
        let mut open = VecDeque::from([(Piece::between(0, last), self.all_checks())]);
        while let Some((piece, checks)) = open.pop_front() {
            let Some(left) = self.left_open(piece, checks) else { return Some(piece.middle()) };
            // A path of one joint vector has no halves.
            if left.is_empty() || last == 0 {
                continue;
            }
            let halves = match piece {
                Piece::Line { knot, halvings: HALVINGS, .. } => return Some(knot),
                Piece::Line { knot, from, to, halvings } => {
                    let (middle, halvings) = (0.5 * (from + to), halvings + 1);
                    let half = |from, to| Piece::Line { knot, from, to, halvings };
                    [half(from, middle), half(middle, to)]
                }
                Piece::Knots(from, to) => {
                    let middle = piece.middle();
                    [Piece::between(from, middle), Piece::between(middle, to)]
                }
            };
            let [first, second] = halves;
            open.push_back((first, left.clone()));
            open.push_back((second, left));
        }
        None
    }

    /// From the tip to the base, as collisions are likelier there.
    fn all_checks(&self) -> Vec<Check> {
        let shapes = self.world.moving.len();
        let scans = (0..shapes).rev().map(Check::Scan);
        let fixed = (0..shapes).rev().map(Check::Fixed);
        let pairs = (0..self.world.pairs.len()).map(Check::Pair);
        scans.chain(fixed).chain(pairs).collect()
    }

    /// What the piece's middle does not prove for all of it; `None` if the middle collides.
    fn left_open(&self, piece: Piece, mut checks: Vec<Check>) -> Option<Vec<Check>> {
        let moves = self.world.bodies_of(&checks);
        let middle;
        let (poses, slack) = match piece {
            Piece::Knots(from, to) => {
                let at = (from + to) / 2;
                (&self.postures[at].poses, self.slack(moves, from, at, to))
            }
            Piece::Line { knot, from, to, .. } => {
                let at = |t: f64| -> JointVector {
                    let (a, b) = (&self.path[knot], &self.path[knot + 1]);
                    JointVector::from_fn(|j| a[j] + t * (b[j] - a[j]))
                };
                middle = Posture::of(self.world, &at(0.5 * (from + to)));
                let halfway = |t: f64| Posture::of(self.world, &at(t));
                let (start, end);
                let ends = [
                    if from == 0.0 {
                        &self.postures[knot]
                    } else {
                        start = halfway(from);
                        &start
                    },
                    if to == 1.0 {
                        &self.postures[knot + 1]
                    } else {
                        end = halfway(to);
                        &end
                    },
                ];
                (&middle.poses, self.line_slack(moves, knot, to - from, &middle, ends))
            }
        };
        let clear =
            |check: Check, slack: &Slack<'_>| self.world.holds(check, poses, self.contact, slack);
        checks.retain(|check| !clear(*check, &slack));
        checks.iter().all(|check| clear(*check, &Slack::NONE)).then_some(checks)
    }

    /// How far any point of the bodies in `moves` is from where it is at joint vector `at`, between
    /// `from` and `to`.
    fn slack(&self, moves: u32, from: usize, at: usize, to: usize) -> Slack<'a> {
        let reach = &self.world.reach;
        let travel: JointVector = JointVector::from_fn(|j| {
            let here = self.travelled[at][j];
            (here - self.travelled[from][j]).max(self.travelled[to][j] - here)
        });
        let mut slack = Slack::new(reach, travel);
        for body in each(moves) {
            let of = |k: usize| {
                let posture = &self.postures[k];
                (&posture.poses[body], &posture.centres[body])
            };
            let chord = (from..=to).map(|k| reach.chord(body, of(at), of(k))).fold(0.0, f64::max);
            let bend = self.bends[from..to].iter().map(|bend| bend[body]).fold(0.0, f64::max);
            slack.body[body] = (chord + bend).min(reach.displacement(body, &travel));
        }
        slack
    }

    /// The same on `share` of the line after a joint vector, from its middle to both ends.
    fn line_slack(
        &self,
        moves: u32,
        knot: usize,
        share: f64,
        middle: &Posture,
        ends: [&Posture; 2],
    ) -> Slack<'a> {
        let reach = &self.world.reach;
        let half = 0.5 * share;
        let travel: JointVector = JointVector::from_fn(|j| {
            half * (self.travelled[knot + 1][j] - self.travelled[knot][j])
        });
        let mut slack = Slack::new(reach, travel);
        for body in each(moves) {
            let of = |posture: &'_ Posture| (posture.poses[body], posture.centres[body]);
            let (frame, centre) = of(middle);
            let chord = ends.iter().map(|end| {
                let (end, end_centre) = of(end);
                reach.chord(body, (&frame, &centre), (&end, &end_centre))
            });
            let bend = self.bends[knot][body] * half * half;
            slack.body[body] =
                (chord.fold(0.0, f64::max) + bend).min(reach.displacement(body, &travel));
        }
        slack
    }
}

impl Posture {
    fn of(world: &World, q: &JointVector) -> Self {
        let poses = world.bodies.poses(q);
        let mut centres = [Vector3::zeros(); MAX_BODIES];
        for (body, (centre, _)) in world.reach.ball.iter().enumerate() {
            centres[body] = poses[body].apply(centre);
        }
        Self { poses, centres }
    }
}

/// The bits that are set.
fn each(bits: u32) -> impl Iterator<Item = usize> {
    (0..MAX_BODIES).filter(move |body| bits >> body & 1 == 1)
}
