//! Following a tool path along the surface with one branch of the inverse kinematics.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_robot::{JointVector, MAX_DOF};

use crate::collision::ToolContact;
use crate::graph::Edge;
use crate::reach::{Sample, Workcell, contact_pose, direction};
use crate::surface::SurfacePoint;

/// The pad's way from one patch to the next: along the surface line, its normal blended, its
/// heading turning evenly from the one patch's to the other's, relative to the line.
#[derive(Clone, Debug)]
pub struct ToolPath {
    stations: Vec<Station>,
    stand_off: f64,
}

/// A point of the surface line.
#[derive(Clone, Copy, Debug)]
struct Station {
    point: Point3<f64>,
    normal: UnitVector3<f64>,
    travel: Vector3<f64>,
    /// Share of the path's length up to here, 0…1.
    share: f64,
}

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
    /// The arm collides.
    Collision,
    /// The branch does not arrive at the sample asked for.
    Elsewhere,
}

/// Farthest that the pad may leave the planned line between two joint vectors. \[m\]
const LINE_TOLERANCE: f64 = 1e-4;
/// Most times that a step of the line is halved to stay within [`LINE_TOLERANCE`].
const MAX_HALVINGS: u32 = 5;
/// A joint that moves further over one step of the line has changed its branch. \[rad\]
const MAX_STEP: f64 = 0.8;

impl ToolPath {
    /// The path along an edge of the graph, from patch `a` to `b` or, `reversed`, back. The
    /// headings are those of the samples at its start and end.
    ///
    /// Shape: edge lines have at least two points.
    #[must_use]
    pub fn along(edge: &Edge, reversed: bool, from: f64, to: f64, stand_off: f64) -> Self {
        let mut line: Vec<SurfacePoint> = edge.line.clone();
        if reversed {
            line.reverse();
        }
        let length: f64 = line.windows(2).map(|w| (w[1].point - w[0].point).norm()).sum();
        let mut stations = Vec::with_capacity(line.len());
        let mut share = 0.0;
        for (i, here) in line.iter().enumerate() {
            let before = line[i.saturating_sub(1)].point;
            let after = line[(i + 1).min(line.len() - 1)].point;
            let chord = after - before;
            let n = here.normal.into_inner();
            let travel = (chord - n * chord.dot(&n)).normalize();
            if i > 0 {
                share += (here.point - before).norm() / length;
            }
            stations.push(Station { point: here.point, normal: here.normal, travel, share });
        }
        let (first, last) = (stations[0], stations[stations.len() - 1]);
        let start = turn(&first, from);
        let end = turn(&last, to);
        let swing = wrap(end - start);
        for s in &mut stations {
            let angle = start + swing * s.share;
            s.travel = s.travel * angle.cos() + s.normal.cross(&s.travel) * angle.sin();
        }
        Self { stations, stand_off }
    }

    /// The contact pose `share` of the way from station `i` to the next.
    fn pose(&self, i: usize, share: f64) -> Isometry3<f64> {
        let a = &self.stations[i];
        if share == 0.0 {
            return contact_pose(&a.point, &a.normal, &a.travel, self.stand_off);
        }
        let b = &self.stations[i + 1];
        let mix = |x: Vector3<f64>, y: Vector3<f64>| x * (1.0 - share) + y * share;
        let normal = UnitVector3::new_normalize(mix(a.normal.into_inner(), b.normal.into_inner()));
        let point = Point3::from(mix(a.point.coords, b.point.coords));
        contact_pose(&point, &normal, &mix(a.travel, b.travel), self.stand_off)
    }

    /// Share of the whole path at `share` of the way from station `i` to the next.
    fn share(&self, i: usize, share: f64) -> f64 {
        let a = self.stations[i].share;
        if share == 0.0 { a } else { a + share * (self.stations[i + 1].share - a) }
    }
}

impl Workcell<'_> {
    /// Follows the path from one sample to another on one branch, the redundancy parameter
    /// changing evenly, and checks limits and collisions at every joint vector of the result;
    /// [`Self::is_proven`] looks between them. There the pad stays within 0.1 mm of the line.
    ///
    /// # Errors
    /// Says what ended the branch, see [`TrackFailure`].
    pub fn follow(
        &self,
        path: &ToolPath,
        from: &Sample,
        to: &Sample,
    ) -> Result<Track, TrackFailure> {
        if from.branch != to.branch {
            return Err(TrackFailure::Elsewhere);
        }
        let mut run = Run {
            cell: self,
            path,
            from,
            to,
            contact_in_tip: self.tool.contact_in_tip(),
            track: Track::default(),
        };
        run.push(from.q, path.pose(0, 0.0));
        for i in 0..path.stations.len() - 1 {
            let pose = path.pose(i + 1, 0.0);
            let near = run.last();
            let q = run.solve(&pose, path.share(i + 1, 0.0), &near)?;
            run.span(i, (0.0, near), (1.0, q), pose, MAX_HALVINGS)?;
        }
        let arrived = run.last();
        if (0..MAX_DOF).any(|j| wrap(arrived[j] - to.q[j]).abs() > 1e-6) {
            return Err(TrackFailure::Elsewhere);
        }
        // All at once: much of what one joint vector proves holds for its neighbours too.
        if !self.world.all_free(&run.track.joints, ToolContact::Allowed) {
            return Err(TrackFailure::Collision);
        }
        Ok(run.track)
    }

    /// Whether the whole motion along the track, the pad on the surface, is free of collision.
    #[must_use]
    pub fn is_proven(&self, track: &[JointVector]) -> bool {
        self.world.path_free(track, ToolContact::Allowed)
    }
}

/// One run of [`Workcell::follow`].
struct Run<'a> {
    cell: &'a Workcell<'a>,
    path: &'a ToolPath,
    from: &'a Sample,
    to: &'a Sample,
    contact_in_tip: Isometry3<f64>,
    track: Track,
}

impl Run<'_> {
    fn last(&self) -> JointVector {
        self.track.joints[self.track.joints.len() - 1]
    }

    fn push(&mut self, q: JointVector, pose: Isometry3<f64>) {
        self.track.joints.push(q);
        self.track.line.push(Point3::from(pose.translation.vector));
    }

    /// The branch's joint vector at a pose, inside the limits.
    fn solve(
        &self,
        pose: &Isometry3<f64>,
        share: f64,
        near: &JointVector,
    ) -> Result<JointVector, TrackFailure> {
        let tip = pose * self.contact_in_tip.inverse();
        let redundancy = self.from.redundancy + share * (self.to.redundancy - self.from.redundancy);
        let found = self.cell.arm.ik().solve_on(self.from.branch, &tip, redundancy, near);
        let q = found.ok_or(TrackFailure::Fold)?.q;
        if (0..MAX_DOF).any(|j| (q[j] - near[j]).abs() > MAX_STEP) {
            return Err(TrackFailure::Fold);
        }
        if !self.cell.arm.within_margins(&q) {
            return Err(TrackFailure::Limit);
        }
        Ok(q)
    }

    /// Appends the joint vectors after `a` up to `b` on station `i`'s step, halving it while
    /// the pad leaves the line between them.
    fn span(
        &mut self,
        i: usize,
        a: (f64, JointVector),
        b: (f64, JointVector),
        b_pose: Isometry3<f64>,
        halvings: u32,
    ) -> Result<(), TrackFailure> {
        let middle: JointVector = std::array::from_fn(|j| 0.5 * (a.1[j] + b.1[j]));
        let share = 0.5 * (a.0 + b.0);
        let pose = self.path.pose(i, share);
        let pad = self.cell.arm.tip_pose(&middle) * self.contact_in_tip;
        let off = (pad.translation.vector - pose.translation.vector).norm();
        if off > LINE_TOLERANCE {
            if halvings == 0 {
                return Err(TrackFailure::Fold);
            }
            let q = self.solve(&pose, self.path.share(i, share), &a.1)?;
            self.span(i, a, (share, q), pose, halvings - 1)?;
            return self.span(i, (share, q), b, b_pose, halvings - 1);
        }
        self.push(b.1, b_pose);
        Ok(())
    }
}

/// The angle from a station's line direction to a heading, about the normal. \[rad\]
fn turn(station: &Station, heading: f64) -> f64 {
    let d = direction(&station.normal, heading);
    let t = station.travel;
    station.normal.cross(&t).dot(&d).atan2(t.dot(&d))
}

/// The angle in (−π, π]. \[rad\]
#[must_use]
pub(crate) fn wrap(angle: f64) -> f64 {
    angle - (angle / std::f64::consts::TAU).round() * std::f64::consts::TAU
}
