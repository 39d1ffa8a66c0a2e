//! A contact piece: the pad's way from where it is set down to where it is lifted off.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use nullsweep_robot::JointVector;
use rayon::prelude::*;

use super::bend::{Bend, Offset};
use super::window::{Window, Windows};
use crate::plan::Plan;
use crate::workcell::{Bed, Workcell};

/// Spacing of the places that a piece is known at. \[m\]
const GRID: f64 = 0.001;
/// How much way along the piece a joint motion counts for, so that a pad that turns on the spot is
/// averaged too. \[m/rad\]
const TURNING: f64 = 0.03;
/// Terms of an average.
const TAPS: usize = 64;
/// Spacing of the places at which the averaged line is laid onto the surface. \[m\]
const LAID: f64 = 0.004;

/// A run of a plan's knots on the surface.
pub(super) struct Piece {
    /// Its first knot in the plan.
    pub(super) first: usize,
    /// Its last knot in the plan.
    pub(super) last: usize,
    /// The patches that it visits, and where along it.
    pub(super) patches: Vec<(f64, u32)>,
    length: f64,
    /// At even distances.
    states: Vec<State>,
}

/// How the pad and the arm are at a place of the way.
#[derive(Clone, Copy, Debug)]
struct State {
    q: JointVector,
    /// The pad's centre. \[m\]
    centre: Vector3<f64>,
    /// The contact frame's x and z.
    travel: Vector3<f64>,
    into: Vector3<f64>,
    /// How far the centre is off the surface, against `into`. \[m\]
    rise: f64,
}

impl State {
    const NONE: Self = Self {
        q: JointVector::ZERO,
        centre: Vector3::new(0.0, 0.0, 0.0),
        travel: Vector3::new(0.0, 0.0, 0.0),
        into: Vector3::new(0.0, 0.0, 0.0),
        rise: 0.0,
    };

    fn add(&mut self, other: &Self, weight: f64) {
        self.q = JointVector::from_fn(|j| self.q[j] + weight * other.q[j]);
        self.centre += other.centre * weight;
        self.travel += other.travel * weight;
        self.into += other.into * weight;
        self.rise += other.rise * weight;
    }
}

/// A place of the averaged way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mean {
    /// Near the joint vector that is wanted, the redundancy as it should be.
    pub(super) q: JointVector,
    centre: Vector3<f64>,
    travel: Vector3<f64>,
    into: Vector3<f64>,
    rise: f64,
}

/// Least length of an averaged unit vector: a pad that turns by more has no mean.
const SHORTEST: f64 = 0.5;

impl Mean {
    /// The contact pose, `laid` \[m\] along its own axis; `None` where the pad turns too much to have a mean.
    pub(super) fn pose(&self, laid: f64) -> Option<Isometry3<f64>> {
        let z = self.into.try_normalize(SHORTEST)?;
        let x = (self.travel - z * self.travel.dot(&z)).try_normalize(SHORTEST)?;
        let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
        let rotation = Rotation3::from_matrix_unchecked(axes);
        let centre = self.centre + z * laid;
        Some(Isometry3::from_parts(centre.into(), UnitQuaternion::from_rotation_matrix(&rotation)))
    }

    /// Bent aside.
    pub(super) fn moved(&self, by: &Offset) -> Self {
        let shift: Vector3<f64> = by.twist.fixed_rows::<3>(0).into();
        let turn = UnitQuaternion::from_scaled_axis(by.twist.fixed_rows::<3>(3));
        Self {
            q: self.q + by.q,
            centre: self.centre + shift,
            travel: turn * self.travel,
            into: turn * self.into,
            rise: self.rise,
        }
    }

    /// The pad's axis; zero where it turns too much to have a mean.
    pub(super) fn axis(&self) -> Vector3<f64> {
        self.into.try_normalize(SHORTEST).unwrap_or_default()
    }

    /// How far along its axis the pad has to go to be off the surface by as much as it was; `None`
    /// over a hole.
    pub(super) fn laid(&self, bed: &Bed) -> Option<f64> {
        let into = self.into.try_normalize(SHORTEST)?;
        let normal = nalgebra::UnitVector3::new_normalize(-into);
        let centre = Point3::from(self.centre);
        let foot = bed.surface().project(&centre, &normal)?;
        Some((foot.point - centre).dot(&into) - self.rise)
    }
}

impl Piece {
    /// All contact pieces of a plan, in their order.
    pub(super) fn all(plan: &Plan, cell: Workcell<'_>, bed: &Bed) -> Vec<Self> {
        let mut pieces = Vec::new();
        let mut first = 0;
        for knot in 0..plan.knots.len() {
            if plan.line(knot).is_none() {
                first = knot + 1;
            } else if knot > first && plan.line(knot + 1).is_none() {
                pieces.extend(Self::new(plan, [first, knot], cell, bed));
            }
        }
        pieces
    }

    fn new(plan: &Plan, [first, last]: [usize; 2], cell: Workcell<'_>, bed: &Bed) -> Option<Self> {
        let pad = cell.tool.on(cell.arm);
        let knots = &plan.knots[first..=last];
        let own = |q: &JointVector| {
            let pose = pad.pose(q);
            let into = pose.rotation * Vector3::z();
            let mean = Mean {
                q: *q,
                centre: pose.translation.vector,
                travel: pose.rotation * Vector3::x(),
                into,
                rise: 0.0,
            };
            let Mean { centre, travel, .. } = mean;
            State { q: *q, centre, travel, into, rise: mean.laid(bed).unwrap_or(0.0) }
        };
        let states: Vec<State> = knots.iter().map(|knot| own(&knot.q)).collect();
        let mut at = vec![0.0];
        for pair in states.windows(2) {
            let turning = TURNING * pair[0].q.distance(&pair[1].q);
            let step = libm::hypot((pair[1].centre - pair[0].centre).norm(), turning);
            at.push(at[at.len() - 1] + step);
        }
        let length = at[at.len() - 1];
        let patches = knots.iter().zip(&at).filter_map(|(k, at)| Some((*at, k.patch?))).collect();
        let count = (length / GRID).ceil() as usize;
        let mut even = Vec::with_capacity(count + 1);
        let mut after = 1;
        for k in 0..=count {
            let u = length * k as f64 / count as f64;
            while after + 1 < at.len() && at[after] < u {
                after += 1;
            }
            let share = ((u - at[after - 1]) / (at[after] - at[after - 1])).clamp(0.0, 1.0);
            let mut state = State::NONE;
            state.add(&states[after - 1], 1.0 - share);
            state.add(&states[after], share);
            even.push(state);
        }
        (count > 0).then_some(Self { first, last, patches, length, states: even })
    }

    /// Of its way, turning included. \[m\]
    pub(super) fn length(&self) -> f64 {
        self.length
    }

    /// Where along it the pad's centre comes nearest to a point, if nearer than `reach`. \[m\]
    pub(super) fn nearest(&self, point: &Point3<f64>, reach: f64) -> Option<f64> {
        let squared = |s: &State| (s.centre - point.coords).norm_squared();
        let (k, distance) =
            self.states.iter().map(squared).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let last = (self.states.len() - 1).max(1);
        (distance <= reach * reach).then_some(self.length * k as f64 / last as f64)
    }

    /// Averaged around a place of it. The window's ends lie within the piece, so its ends stay.
    pub(super) fn mean(&self, u: f64, window: Window) -> Mean {
        let near = self.averaged(u, window.place);
        let State { centre, into, rise, .. } = near;
        let travel = self.averaged(u, window.heading).travel;
        let q = self.averaged(u, window.joints).q;
        Mean { q, centre, travel, into, rise }
    }

    /// How many steps there are between the places at which it is laid onto the surface, [`LAID`] apart
    /// at most.
    pub(super) fn steps(&self) -> usize {
        (self.length / LAID).ceil().max(1.0) as usize
    }

    /// How far the averaged and bent way has to be shifted along the pad's axis.
    pub(super) fn laid(&self, bed: &Bed, windows: &Windows, bend: &Bend) -> Laid {
        let count = self.steps();
        let shift = |k: usize| {
            let u = self.length * k as f64 / count as f64;
            self.mean(u, windows.at(u)).moved(&bend.at(u)).laid(bed).unwrap_or(0.0)
        };
        Laid::new(self.length, (0..=count).into_par_iter().map(shift).collect())
    }

    fn averaged(&self, u: f64, width: f64) -> State {
        let mut sum = State::NONE;
        let last = (self.states.len() - 1) as f64;
        let mut total = 0.0;
        for tap in 0..TAPS {
            let t = (2.0 * tap as f64 + 1.0) / TAPS as f64 - 1.0;
            let weight = (1.0 - t * t).powi(2);
            let place = ((u + 0.5 * width * t) / self.length * last).clamp(0.0, last);
            let k = (place as usize).min(self.states.len() - 2);
            let share = place - k as f64;
            sum.add(&self.states[k], weight * (1.0 - share));
            sum.add(&self.states[k + 1], weight * share);
            total += weight;
        }
        let mut mean = State::NONE;
        mean.add(&sum, 1.0 / total);
        mean
    }
}

/// Shifts onto the surface along a piece.
pub(super) struct Laid {
    length: f64,
    shifts: Vec<f64>,
}

impl Laid {
    /// By the shifts at even distances along a piece of some length. \[m\]
    pub(super) fn new(length: f64, shifts: Vec<f64>) -> Self {
        Self { length, shifts }
    }

    /// Averaged over as much as the way itself. \[m\]
    pub(super) fn at(&self, u: f64, window: Window) -> f64 {
        let last = (self.shifts.len() - 1) as f64;
        let (mut sum, mut total) = (0.0, 0.0);
        for tap in 0..TAPS {
            let t = (2.0 * tap as f64 + 1.0) / TAPS as f64 - 1.0;
            let weight = (1.0 - t * t).powi(2);
            let place = ((u + 0.5 * window.place * t) / self.length * last).clamp(0.0, last);
            let k = (place as usize).min(self.shifts.len() - 2);
            let share = place - k as f64;
            sum += weight * (self.shifts[k] * (1.0 - share) + self.shifts[k + 1] * share);
            total += weight;
        }
        sum / total
    }
}
