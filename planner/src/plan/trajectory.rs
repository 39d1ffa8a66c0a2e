//! The timed path through a plan's knots, as the executor interpolates it.

use nalgebra::Point3;
use nullsweep_robot::{JointVector, Tool};

use super::curve::Curve;
use super::knot::PlanKnot;
use super::settings::Profile;

/// Knots with what it takes to follow them.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory<'a> {
    /// The tool at the arm's tip.
    pub tool: &'a Tool,
    /// How the joints move between knots.
    pub profile: Profile,
    /// The knots.
    pub knots: &'a [PlanKnot],
}

impl Trajectory<'_> {
    /// The planned pad centre of a knot on the surface, root frame. \[m\]
    #[must_use]
    pub fn line(&self, knot: usize) -> Option<Point3<f64>> {
        self.knots.get(knot)?.line.map(Point3::from)
    }

    /// The motion that ends in a knot; a stand-still at the first one.
    #[must_use]
    pub fn curve(&self, knot: usize) -> Curve {
        let (a, b) = (&self.knots[knot.saturating_sub(1)], &self.knots[knot]);
        let seconds = b.time_ns.saturating_sub(a.time_ns) as f64 * 1e-9;
        match self.profile {
            Profile::Velocity => Curve::line(&a.q, &b.q, seconds),
            Profile::Acceleration | Profile::Jerk => {
                Curve::cubic((&a.q, &a.v), (&b.q, &b.v), seconds)
            }
        }
    }

    /// Whether the pad is on the surface in the segment that ends in a knot.
    #[must_use]
    pub fn on_surface(&self, knot: usize) -> bool {
        let before = self.line(knot.saturating_sub(1));
        before.is_some() && self.line(knot).is_some()
    }
}

/// Goes along a trajectory in time, forwards.
#[derive(Clone, Copy, Debug)]
pub struct TrajectoryCursor<'a> {
    path: Trajectory<'a>,
    /// The knot in which the segment of the last time ends.
    knot: usize,
}

impl<'a> TrajectoryCursor<'a> {
    /// At its start; it has two knots or more.
    #[must_use]
    pub fn new(path: Trajectory<'a>) -> Self {
        Self { path, knot: 1 }
    }

    /// The knot in which the segment of a time \[ns\] ends, and where the joints are then; before the
    /// start and after the end where they are there. Times must not fall from call to call.
    pub fn at(&mut self, time_ns: u64) -> (usize, JointVector) {
        let knots = self.path.knots;
        while self.knot + 1 < knots.len() && knots[self.knot].time_ns < time_ns {
            self.knot += 1;
        }
        let curve = self.path.curve(self.knot);
        let since = time_ns.saturating_sub(knots[self.knot - 1].time_ns) as f64 * 1e-9;
        (self.knot, curve.at(since / curve.seconds()))
    }
}
