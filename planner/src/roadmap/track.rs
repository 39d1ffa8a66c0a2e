//! Following a tool path along the surface with one branch of the inverse kinematics.

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::ToolContact;
use nullsweep_robot::{Branch, JointLimits, JointVector, MAX_DOF, wrap};

use super::path::ToolPath;
use crate::plan::LINE_TOLERANCE;
use crate::workcell::{Sample, Workcell};

/// Joint vectors and pad centres along a tool path, both ends included.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Joint vectors, continuous joints unwrapped. \[rad\] or \[m\]
    pub joints: Vec<JointVector>,
    /// The planned pad centre of each joint vector, root frame. \[m\]
    pub line: Vec<Point3<f64>>,
}

/// Why a tool path cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackFailure {
    /// The branch ends: out of reach, or two branches meet.
    Fold,
    /// It leaves the margined soft limits.
    Limit,
    /// The arm collides, or no proof was found that it does not.
    Collision,
    /// The branch does not arrive at the sample asked for.
    Elsewhere,
    /// A roller would be moved sideways.
    Sideways,
}

/// Where along a tool path it could not be followed, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocked {
    /// Why.
    pub why: TrackFailure,
    /// Share of the path's length up to there, 0…1.
    pub share: f64,
    /// Value of the redundancy parameter there. \[rad\]
    pub redundancy: f64,
}

/// Most times that a step of the line is halved to stay within [`LINE_TOLERANCE`].
const MAX_HALVINGS: u32 = 5;
/// Farthest that what a tool works on from afar is from the line on the surface. \[m\]
const AFAR_TOLERANCE: f64 = 0.001;
/// A joint that moves further over one step of the line has changed its branch. \[rad\]
const MAX_STEP: f64 = 0.8;

impl Workcell<'_> {
    /// Follows the path from one sample to another on one branch, the redundancy parameter
    /// changing evenly. All joint vectors of the result are inside the limits, the whole motion
    /// is proven free of collision, the pad on the surface, and in the
    /// middle between two of them the pad is within 0.1 mm of the line.
    ///
    /// # Errors
    /// Says what ended the branch and where. [`Self::detour`] may still find a way.
    pub fn follow(&self, path: &ToolPath, from: &Sample, to: &Sample) -> Result<Track, Blocked> {
        let last = path.stations() - 1;
        let redundancy = |station: usize| {
            from.redundancy + path.share(station) * (to.redundancy - from.redundancy)
        };
        let blocked = |station: usize, why: TrackFailure| Blocked {
            why,
            share: path.share(station),
            redundancy: redundancy(station),
        };
        if from.branch != to.branch {
            return Err(blocked(last, TrackFailure::Elsewhere));
        }
        if !path.is_for(self.tool) {
            return Err(blocked(0, TrackFailure::Sideways));
        }
        let mut run = Follower::new(*self, path, from);
        for station in 1..=last {
            let (redundancy, pose) = (redundancy(station), path.pose(station));
            run.solve(&pose, redundancy, &run.last.q)
                .and_then(|q| run.step(Place { share: 1.0, q, redundancy, pose }))
                .map_err(|why| blocked(station, why))?;
        }
        if !arrives(self.arm.limits(), &run.last.q, &to.q) {
            return Err(blocked(last, TrackFailure::Elsewhere));
        }
        match self.world.unproven(&run.track.joints, ToolContact::Allowed) {
            None => Ok(run.track),
            Some(knot) => Err(blocked(run.station_at(knot), TrackFailure::Collision)),
        }
    }
}

/// Whether a branch that came to `q` is where it should be. Only a joint without limits may be whole
/// turns from there.
pub(crate) fn arrives(limits: &[JointLimits], q: &JointVector, at: &JointVector) -> bool {
    limits.iter().enumerate().all(|(j, limits)| {
        let off = q[j] - at[j];
        (if limits.continuous { wrap(off) } else { off }).abs() <= 1e-6
    })
}

/// Whether no joint goes so far from `a` to `b` that another branch must be there.
pub(crate) fn is_step(a: &JointVector, b: &JointVector) -> bool {
    (0..MAX_DOF).all(|j| (b[j] - a[j]).abs() <= MAX_STEP)
}

/// A joint vector of the branch on one step of the line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Share of the step.
    pub(crate) share: f64,
    pub(crate) q: JointVector,
    pub(crate) redundancy: f64,
    /// Contact pose.
    pub(crate) pose: Isometry3<f64>,
}

/// The way along a tool path on one branch, from station to station.
pub(crate) struct Follower<'a> {
    cell: Workcell<'a>,
    path: &'a ToolPath,
    branch: Branch,
    contact_in_tip: Isometry3<f64>,
    tip_in_contact: Isometry3<f64>,
    /// How many joint vectors the track has up to each station that was reached.
    knots: Vec<usize>,
    pub(crate) last: Place,
    pub(crate) track: Track,
}

impl<'a> Follower<'a> {
    pub(crate) fn new(cell: Workcell<'a>, path: &'a ToolPath, from: &Sample) -> Self {
        let contact_in_tip = cell.tool.contact_in_tip();
        let (q, redundancy, pose) = (from.q, from.redundancy, path.pose(0));
        Self {
            cell,
            path,
            branch: from.branch,
            contact_in_tip,
            tip_in_contact: contact_in_tip.inverse(),
            knots: vec![1],
            last: Place { share: 0.0, q, redundancy, pose },
            track: Track { joints: vec![q], line: vec![pose.translation.vector.into()] },
        }
    }

    /// The branch's joint vector at a pose, inside the limits; joints unwrapped nearest to `near`.
    pub(crate) fn solve(
        &self,
        pose: &Isometry3<f64>,
        redundancy: f64,
        near: &JointVector,
    ) -> Result<JointVector, TrackFailure> {
        let tip = pose * self.tip_in_contact;
        let found = self.cell.arm.ik().solve_on(self.branch, &tip, redundancy, near);
        let q = found.ok_or(TrackFailure::Fold)?.q;
        if !self.cell.arm.within_margins(&q) {
            return Err(TrackFailure::Limit);
        }
        Ok(q)
    }

    /// Goes on to a place at the next station, the redundancy parameter changing evenly.
    pub(crate) fn step(&mut self, to: Place) -> Result<(), TrackFailure> {
        self.span(Place { share: 0.0, ..self.last }, to, MAX_HALVINGS)?;
        self.knots.push(self.track.joints.len());
        self.last = to;
        Ok(())
    }

    /// The last station up to a joint vector of the track.
    pub(crate) fn station_at(&self, knot: usize) -> usize {
        last_up_to(&self.knots, knot)
    }

    /// Whether the pad is where it is to be, and of a tool that works from afar, which a small turn moves
    /// far on the surface, what it works on.
    fn is_on_line(&self, pad: &Isometry3<f64>, wanted: &Isometry3<f64>) -> bool {
        let tool = self.cell.tool;
        let ahead = Point3::new(0.0, 0.0, tool.stand_off);
        (pad.translation.vector - wanted.translation.vector).norm() <= LINE_TOLERANCE
            && (tool.touches() || (pad * ahead - wanted * ahead).norm() <= AFAR_TOLERANCE)
    }

    /// Appends the joint vectors after `a` up to `b`, halving the way while the pad leaves the line
    /// between them.
    fn span(&mut self, a: Place, b: Place, halvings: u32) -> Result<(), TrackFailure> {
        if !is_step(&a.q, &b.q) {
            return Err(TrackFailure::Fold);
        }
        let middle: JointVector = JointVector::from_fn(|j| 0.5 * (a.q[j] + b.q[j]));
        let share = 0.5 * (a.share + b.share);
        let pose = self.path.between(self.knots.len() - 1, share);
        let pad = self.cell.arm.tip_pose(&middle) * self.contact_in_tip;
        if !self.is_on_line(&pad, &pose) {
            if halvings == 0 {
                return Err(TrackFailure::Fold);
            }
            let redundancy = 0.5 * (a.redundancy + b.redundancy);
            let q = self.solve(&pose, redundancy, &a.q)?;
            let half = Place { share, q, redundancy, pose };
            self.span(a, half, halvings - 1)?;
            return self.span(half, b, halvings - 1);
        }
        self.track.joints.push(b.q);
        self.track.line.push(b.pose.translation.vector.into());
        Ok(())
    }
}

/// The last of the stations, given how many joint vectors there are up to each, that is not beyond
/// joint vector `knot`. The first joint vector is the first station's.
fn last_up_to(counts: &[usize], knot: usize) -> usize {
    counts.partition_point(|&count| count <= knot + 1).max(1) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_vector_belongs_to_the_station_at_or_before_it() {
        // One joint vector between the first two stations.
        let stations: Vec<usize> = (0..4).map(|knot| last_up_to(&[1, 3, 4], knot)).collect();
        assert_eq!(stations, [0, 0, 1, 2]);
    }
}
