//! Proofs that nothing collides along a whole joint path.
//!
//! One joint vector in the middle of a path proves much of it: whatever is there farther from
//! everything than it can move up to the path's ends needs no second look. So each thing to check
//! (a shape against the scan, a shape against what stands still, a pair of shapes) is followed by
//! itself, and only for what is left open the path is halved.

use super::ToolContact;
use super::bodies::MAX_BODIES;
use super::frame::Frame;
use super::motion::Slack;
use super::world::World;
use nalgebra::Vector3;
use nullsweep_robot::{JointVector, MAX_DOF};
use std::collections::VecDeque;

/// The straight line between two joint vectors is halved at most this often before it counts as
/// not proven.
const HALVINGS: u32 = 7;

/// One thing to check, by its index in the world.
#[derive(Clone, Copy, Debug)]
pub(super) enum Check {
    /// A moving shape against the scan.
    Scan(usize),
    /// A moving shape against the fixed shapes.
    Fixed(usize),
    /// A pair of moving shapes.
    Pair(usize),
}

/// A part of a path.
#[derive(Clone, Copy, Debug)]
enum Piece {
    /// From one joint vector of the path to another.
    Knots(usize, usize),
    /// On the line from joint vector `knot` to the next, between two shares of it.
    Line { knot: usize, from: f64, to: f64, halvings: u32 },
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
    /// Way of each joint from the path's start up to each joint vector. \[rad\] or \[m\]
    ways: Vec<JointVector>,
    /// How far each line bends, see [`super::motion::Reach::bend`]; none: only the joint vectors
    /// themselves are looked at. \[m\]
    bends: Option<Vec<[f64; MAX_BODIES]>>,
}

impl World {
    /// Whether the whole straight joint line from `a` to `b` is proven free. False if a collision
    /// is found, or if no proof is found within 7 halvings (a motion that grazes a margin).
    #[must_use]
    pub fn motion_free(&self, a: &JointVector, b: &JointVector, contact: ToolContact) -> bool {
        // The end first: it is where a useless motion is most often seen to be one.
        self.is_free(b, contact) && self.path_free(&[*a, *b], contact)
    }

    /// Whether the whole path, straight joint lines from one joint vector to the next, is proven
    /// free; see [`Self::motion_free`].
    #[must_use]
    pub fn path_free(&self, path: &[JointVector], contact: ToolContact) -> bool {
        path.iter().all(|q| self.is_in_range(q)) && Proof::new(self, path, contact, true).holds()
    }

    /// Whether each of the joint vectors is free, whatever is between them. Neighbours are best
    /// near each other.
    #[must_use]
    pub fn all_free(&self, path: &[JointVector], contact: ToolContact) -> bool {
        path.iter().all(|q| self.is_in_range(q)) && Proof::new(self, path, contact, false).holds()
    }
}

impl<'a> Proof<'a> {
    fn new(world: &'a World, path: &'a [JointVector], contact: ToolContact, between: bool) -> Self {
        let mut ways = vec![[0.0; MAX_DOF]];
        let mut bends = between.then(Vec::new);
        for pair in path.windows(2) {
            let way = std::array::from_fn(|j| (pair[1][j] - pair[0][j]).abs());
            let before = ways[ways.len() - 1];
            ways.push(std::array::from_fn(|j| before[j] + way[j]));
            if let Some(bends) = &mut bends {
                let mut bend = [0.0; MAX_BODIES];
                for (body, bend) in bend.iter_mut().enumerate().take(world.bodies.bodies.len()) {
                    *bend = world.reach.bend(body, &way);
                }
                bends.push(bend);
            }
        }
        let postures = path.iter().map(|q| Posture::of(world, q)).collect();
        Self { world, path, contact, postures, ways, bends }
    }

    fn holds(&self) -> bool {
        if self.path.is_empty() {
            return true;
        }
        // Coarse pieces first: they find a collision soonest.
        let mut open = VecDeque::from([(Piece::Knots(0, self.path.len() - 1), self.all_checks())]);
        while let Some((piece, checks)) = open.pop_front() {
            let Some(left) = self.left_open(piece, checks) else { return false };
            if left.is_empty() {
                continue;
            }
            match piece {
                Piece::Knots(from, to) if from == to => {}
                Piece::Knots(from, to) if self.bends.is_none() => {
                    let middle = (from + to) / 2;
                    if middle > from {
                        open.push_back((Piece::Knots(from, middle - 1), left.clone()));
                    }
                    open.push_back((Piece::Knots(middle + 1, to), left));
                }
                Piece::Knots(from, to) if to - from == 1 => {
                    open.push_back((
                        Piece::Line { knot: from, from: 0.0, to: 1.0, halvings: 0 },
                        left,
                    ));
                }
                Piece::Knots(from, to) => {
                    let middle = (from + to) / 2;
                    open.push_back((Piece::Knots(from, middle), left.clone()));
                    open.push_back((Piece::Knots(middle, to), left));
                }
                Piece::Line { halvings: HALVINGS, .. } => return false,
                Piece::Line { knot, from, to, halvings } => {
                    let (middle, halvings) = (0.5 * (from + to), halvings + 1);
                    let half = |from, to| Piece::Line { knot, from, to, halvings };
                    open.push_back((half(from, middle), left.clone()));
                    open.push_back((half(middle, to), left));
                }
            }
        }
        true
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
                    std::array::from_fn(|j| a[j] + t * (b[j] - a[j]))
                };
                middle = Posture::of(self.world, &at(0.5 * (from + to)));
                let ends = [from, to].map(|t| Posture::of(self.world, &at(t)));
                (&middle.poses, self.line_slack(moves, knot, to - from, &middle, &ends))
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
        let way: JointVector = std::array::from_fn(|j| {
            let here = self.ways[at][j];
            (here - self.ways[from][j]).max(self.ways[to][j] - here)
        });
        let mut slack = Slack::new(reach, way);
        for body in each(moves) {
            let of = |k: usize| {
                let posture = &self.postures[k];
                (&posture.poses[body], &posture.centres[body])
            };
            let chord = (from..=to).map(|k| reach.chord(body, of(at), of(k))).fold(0.0, f64::max);
            let bend = self.bends.as_ref().map_or(0.0, |bends| {
                bends[from..to].iter().map(|bend| bend[body]).fold(0.0, f64::max)
            });
            slack.body[body] = (chord + bend).min(reach.way(body, &way));
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
        ends: &[Posture; 2],
    ) -> Slack<'a> {
        let reach = &self.world.reach;
        let half = 0.5 * share;
        let way: JointVector =
            std::array::from_fn(|j| half * (self.ways[knot + 1][j] - self.ways[knot][j]));
        let mut slack = Slack::new(reach, way);
        for body in each(moves) {
            let of = |posture: &'_ Posture| (posture.poses[body], posture.centres[body]);
            let (frame, centre) = of(middle);
            let chord = ends.iter().map(|end| {
                let (end, end_centre) = of(end);
                reach.chord(body, (&frame, &centre), (&end, &end_centre))
            });
            let bend = self.bends.as_ref().map_or(0.0, |bends| bends[knot][body]) * half * half;
            slack.body[body] = (chord.fold(0.0, f64::max) + bend).min(reach.way(body, &way));
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
