//! The motions between two tool poses, as the layered search asks for them.

use nullsweep_robot::JointVector;
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::jump::{is_joined, jump};
use super::layered::{Link, Motion, Moves};
use super::leg::Leg;
use super::memo::{How, Key, Memo};
use super::retreat::lift;
use crate::cost::{self, Cost};
use crate::roadmap::{Blocked, Edge, Graph, ToolPath, Track};
use crate::workcell::{Sample, Workcell};

/// Makes motions in a workcell and prices them.
pub struct Mover<'a, C> {
    cell: Workcell<'a>,
    graph: &'a Graph,
    /// The patch of each stop of the tour.
    stops: &'a [usize],
    cost: &'a C,
    source: JointVector,
    memo: &'a Memo,
    /// Added to every jump, so that the tool does not leave the surface for a trifle: see
    /// [`lift_cost`].
    lift: f64,
}

/// Joints whose motion is what a jump adds.
const LIFT_JOINTS: usize = 4;
/// How far each of them moves. \[rad\]
const LIFT_ANGLE: f64 = 0.8;

/// Joint vectors are alike no joint of which is farther apart, but for the last, which turns the pad.
/// \[rad\] or \[m\]
const ALIKE: f64 = 0.25;

/// What a jump costs besides its path: four joints moved by 0.8 rad, for an arm of `dof` joints.
#[must_use]
pub fn lift_cost<C: Cost>(cost: &C, dof: usize) -> f64 {
    let mut lift = JointVector::ZERO;
    lift[..LIFT_JOINTS.min(dof)].fill(LIFT_ANGLE);
    cost.of(&lift)
}

impl<'a, C: Cost> Mover<'a, C> {
    /// For a tour over the patches `stops` and an arm that stands at `source` before the first motion.
    /// `memo` is of the same workcell and cost, and has the seed of every random choice.
    #[must_use]
    pub fn new(
        cell: Workcell<'a>,
        graph: &'a Graph,
        stops: &'a [usize],
        cost: &'a C,
        source: JointVector,
        memo: &'a Memo,
    ) -> Self {
        let lift = lift_cost(cost, cell.arm.dof());
        Self { cell, graph, stops, cost, source, memo, lift }
    }

    /// The motion along an edge, or `reversed` back, free of collision; `None` where the branch
    /// cannot be followed, whatever the redundancy parameter does on the way.
    #[must_use]
    pub fn along(
        &self,
        edge: &Edge,
        reversed: bool,
        from: &Sample,
        to: &Sample,
    ) -> Option<Motion<Leg>> {
        let path = self.path(edge, reversed, from, to);
        let around = || self.cell.detour(&path, &[*from], &[*to]);
        self.cell.follow(&path, from, to).ok().or_else(around).map(|track| self.leg(track))
    }

    fn path(&self, edge: &Edge, reversed: bool, from: &Sample, to: &Sample) -> ToolPath {
        ToolPath::along(edge, reversed, from.heading, to.heading, self.cell.tool.stand_off)
    }

    fn leg(&self, track: Track) -> Motion<Leg> {
        let cost = cost::of_path(self.cost, &track.joints);
        let line = track.line.into_iter().map(Some).collect();
        Motion { cost, path: Leg { joints: track.joints, line } }
    }

    /// A seed that depends on the two ends alone, not on when or on which thread it is asked for.
    fn seed_of(&self, from: &JointVector, to: &JointVector) -> u64 {
        let mut bytes = Vec::with_capacity(2 * size_of::<JointVector>());
        for value in from.iter().chain(to) {
            bytes.extend_from_slice(&value.to_bits().to_le_bytes());
        }
        xxh3_64_with_seed(&bytes, self.memo.seed)
    }
}

/// The patches that a way along an edge leads from and to.
fn ends(edge: &Edge, reversed: bool) -> (usize, usize) {
    if reversed { (edge.b, edge.a) } else { (edge.a, edge.b) }
}

impl<C: Cost> Moves for Mover<'_, C> {
    type Path = Leg;

    fn link(&self, from: usize, to: usize) -> Link {
        let (a, b) = (self.stops[from], self.stops[to]);
        match self.graph.between(a, b) {
            Some(edge) => Link::Surface { edge, reversed: self.graph.edges[edge].a != a },
            None => Link::Jump,
        }
    }

    fn track(
        &self,
        (edge, reversed): (usize, bool),
        from: &Sample,
        to: &Sample,
    ) -> Result<Motion<Leg>, Blocked> {
        let edge = &self.graph.edges[edge];
        let (a, b) = ends(edge, reversed);
        self.memo.tracks.get(Key::new(How::Surface(a, b), &from.q, to), || {
            let path = self.path(edge, reversed, from, to);
            self.cell.follow(&path, from, to).map(|track| self.leg(track))
        })
    }

    fn around(
        &self,
        (edge, reversed): (usize, bool),
        from: &Sample,
        to: &Sample,
    ) -> Option<Motion<Leg>> {
        let edge = &self.graph.edges[edge];
        let (a, b) = ends(edge, reversed);
        let key = Key::new(How::Surface(a, b), &from.q, to);
        self.memo.ways.get(key, || self.along(edge, reversed, from, to))
    }

    fn jump(&self, from: Option<&Sample>, to: &Sample) -> Option<Motion<Leg>> {
        let start = from.map_or(self.source, |s| s.q);
        let how = if from.is_some() { How::Jump } else { How::Start };
        self.memo.ways.get(Key::new(how, &start, to), || {
            let mut joints = jump(self.cell, &start, &to.q, self.seed_of(&start, &to.q))?;
            // A tool that works from afar need not be lifted, and may go straight; it does not work there.
            if let [first, last] = joints[..] {
                joints.insert(1, first.lerp(&last, 0.5));
            }
            let cost = self.lift + cost::of_path(self.cost, &joints);
            let pad = self.cell.tool.on(self.cell.arm);
            let mut line = vec![None; joints.len()];
            if from.is_some() {
                line[0] = Some(pad.centre(&joints[0]));
            }
            if let (Some(last), Some(q)) = (line.last_mut(), joints.last()) {
                *last = Some(pad.centre(q));
            }
            Some(Motion { cost, path: Leg { joints, line } })
        })
    }

    fn lifts(&self, at: &Sample) -> bool {
        lift(self.cell, &at.q).is_some()
    }

    fn is_joined(&self, at: &Sample) -> bool {
        self.memo.joined.get(Key::new(How::Start, &self.source, at), || {
            is_joined(self.cell, &self.source, &at.q, self.seed_of(&self.source, &at.q))
        })
    }

    fn are_alike(&self, a: &Sample, b: &Sample) -> bool {
        let turns_the_pad = self.cell.arm.dof() - 1;
        let apart = self.cell.arm.continuous().displacement(&a.q, &b.q);
        a.branch == b.branch && apart[..turns_the_pad].iter().all(|joint| joint.abs() <= ALIKE)
    }

    fn jump_estimate(&self, straight: f64) -> f64 {
        self.lift + straight
    }
}
