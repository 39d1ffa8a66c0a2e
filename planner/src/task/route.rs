//! A route through all poses: its cost, its relaxation, small changes of its order.

use nalgebra::Isometry3;
use nullsweep_robot::JointVector;

use crate::poses::{Point, Space};

/// Poses in the order in which they are visited, and the joint vector at each.
#[derive(Clone, Debug)]
pub(super) struct Route {
    /// Indices of poses.
    pub(super) order: Vec<usize>,
    /// For each pose, by its index.
    pub(super) points: Vec<Point>,
}

/// What an edge that changes the posture costs besides its length: more than any detour. \[rad\]
pub(super) const PENALTY: f64 = 20.0;
/// A relaxed joint vector that gains less than this stays. \[rad\]
const GAIN: f64 = 1e-6;
/// One that gains less than this gives no reason to look for other places again. \[rad\]
const LITTLE: f64 = 1e-4;
/// Neighbours in the pose's list beside which it is tried.
const BESIDE: usize = 10;

/// What of a route has to be looked at again, by pose.
pub(super) struct Unsettled {
    /// Whether its joint vector, or one beside it, was changed since it did not gain any more.
    loose: Vec<bool>,
    /// Whether it was moved by more than a little since places were looked for.
    moved: Vec<bool>,
}

impl Unsettled {
    /// All of so many poses.
    pub(super) fn all(poses: usize) -> Self {
        Self { loose: vec![true; poses], moved: vec![true; poses] }
    }

    /// A pose was changed, those beside it are to be looked at too.
    fn changed(&mut self, order: &[usize], at: usize, gain: f64) {
        for &pose in &order[at.saturating_sub(1)..(at + 2).min(order.len())] {
            self.loose[pose] = true;
            self.moved[pose] |= gain > LITTLE;
        }
    }
}

/// Poses, their neighbours and the space that they are met in.
pub(super) struct Task<'a> {
    pub(super) space: Space<'a>,
    pub(super) poses: &'a [Isometry3<f64>],
    /// For each pose the others, nearest first, as many as are looked at.
    pub(super) near: Vec<Vec<usize>>,
}

impl Task<'_> {
    /// Length of an edge with its penalty. \[rad\]
    pub(super) fn edge(&self, a: &Point, b: &Point) -> f64 {
        let length = a.q.distance(&b.q);
        if self.space.is_reconfiguration(a, b) { length + PENALTY } else { length }
    }

    /// Sum over all edges. \[rad\]
    pub(super) fn cost(&self, route: &Route) -> f64 {
        route.order.windows(2).map(|w| self.edge(&route.points[w[0]], &route.points[w[1]])).sum()
    }

    /// Moves every joint vector to where it makes the way shorter, one after the other, again and
    /// again; at most `sweeps` times.
    pub(super) fn relax(&self, route: &mut Route, open: &mut Unsettled, sweeps: usize) {
        for sweep in 0..sweeps {
            let mut gained = 0.0;
            let count = route.order.len();
            for step in 0..count {
                // Forwards and backwards in turn, so that changes travel both ways.
                let at = if sweep % 2 == 0 { step } else { count - 1 - step };
                let pose = route.order[at];
                if !std::mem::take(&mut open.loose[pose]) {
                    continue;
                }
                let gain = self.relax_at(route, at);
                if gain > 0.0 {
                    open.changed(&route.order, at, gain);
                }
                gained += gain;
            }
            if gained < 1e-5 * count as f64 {
                return;
            }
        }
    }

    /// Moves the joint vector at one place of the order; returns what is gained. \[rad\]
    fn relax_at(&self, route: &mut Route, at: usize) -> f64 {
        let pose = route.order[at];
        let before = at.checked_sub(1).map(|k| route.points[route.order[k]]);
        let after = route.order.get(at + 1).map(|&k| route.points[k]);
        let here = route.points[pose];
        let local = |point: &Point| {
            let to = |other: &Option<Point>| other.map_or(0.0, |o| self.edge(&o, point));
            to(&before) + to(&after)
        };
        let old = local(&here);
        let target: JointVector = match (&before, &after) {
            (Some(a), Some(b)) => {
                // The way is shortest where both neighbours pull with the same force; Weiszfeld's
                // step goes there, and the projection back onto what meets the pose.
                let pull = |o: &Point| 1.0 / (o.q.distance(&here.q) + 1e-3);
                let (u, v) = (pull(a), pull(b));
                JointVector::from_fn(|j| (u * a.q[j] + v * b.q[j]) / (u + v))
            }
            (Some(one), None) | (None, Some(one)) => one.q,
            (None, None) => return 0.0,
        };
        // The whole step, or less where it overshoots.
        for share in [1.0, 0.4, 0.1] {
            let q = JointVector::from_fn(|j| here.q[j] + share * (target[j] - here.q[j]));
            let Some(point) = self.space.project(&self.poses[pose], &q) else { continue };
            let gain = old - local(&point);
            if gain > GAIN && self.space.is_free(&point) {
                route.points[pose] = point;
                return gain;
            }
        }
        0.0
    }

    /// Takes single poses out and puts them where they cost least, their joint vectors moved to
    /// suit the new place; returns what is gained. \[rad\]
    pub(super) fn reinsert(&self, route: &mut Route, open: &mut Unsettled) -> f64 {
        let mut gained = 0.0;
        let mut moved = std::mem::replace(&mut open.moved, vec![false; self.poses.len()]);
        let mut place = vec![usize::MAX; self.poses.len()];
        route.order.iter().enumerate().for_each(|(k, &pose)| place[pose] = k);
        for pose in 0..self.poses.len() {
            let at = place[pose];
            if at == usize::MAX {
                continue;
            }
            let beside = self.near[pose].iter().take(BESIDE);
            if !moved[pose] && !beside.clone().any(|&other| moved[other]) {
                continue;
            }
            let point =
                |k: Option<usize>| k.and_then(|k| route.order.get(k)).map(|&p| route.points[p]);
            let (before, after) = (point(at.checked_sub(1)), point(Some(at + 1)));
            let here = route.points[pose];
            let to = |a: &Option<Point>, b: &Option<Point>| match (a, b) {
                (Some(a), Some(b)) => self.edge(a, b),
                _ => 0.0,
            };
            let saved = to(&before, &Some(here)) + to(&Some(here), &after) - to(&before, &after);
            if saved < 1e-3 {
                continue;
            }
            // Places are those of the order without this pose.
            let rest = |k: usize| point(Some(k + usize::from(k >= at)));
            let mut best: Option<(f64, usize, Point)> = None;
            for &other in beside {
                if place[other] == usize::MAX {
                    continue;
                }
                let beside = place[other] - usize::from(place[other] > at);
                for k in [beside, beside + 1] {
                    let (a, b) = (k.checked_sub(1).and_then(rest), rest(k));
                    let start = match (&a, &b) {
                        (Some(a), Some(b)) => JointVector::from_fn(|j| 0.5 * (a.q[j] + b.q[j])),
                        (Some(one), None) | (None, Some(one)) => one.q,
                        (None, None) => continue,
                    };
                    let Some(new) = self.space.project(&self.poses[pose], &start) else { continue };
                    let cost = to(&a, &Some(new)) + to(&Some(new), &b) - to(&a, &b);
                    if cost < best.as_ref().map_or(saved - 1e-6, |b| b.0)
                        && self.space.is_free(&new)
                    {
                        best = Some((cost, k, new));
                    }
                }
            }
            if let Some((cost, to, new)) = best {
                route.order.remove(at);
                route.order.insert(to, pose);
                for k in at.min(to)..=at.max(to) {
                    place[route.order[k]] = k;
                }
                route.points[pose] = new;
                gained += saved - cost;
                for at in [at.min(route.order.len() - 1), to] {
                    open.changed(&route.order, at, saved - cost);
                }
                moved[pose] = true;
            }
        }
        gained
    }
}
