//! A piece bent so that the joints go along it in less time.
//!
//! What the joints may do between the ends of a piece is a curve of offsets: in the null space, where
//! the pad does not feel it, and as far as the pad may leave its averaged way. The time of the fastest
//! motion is made less by Newton's method. With the times of the fastest motion now, a joint's
//! acceleration and velocity along it are linear in the offsets; the joint that is at its limit is the
//! one that counts, so of the shares of the limits that are used the sixth powers are made least, and
//! leaving the averaged way costs besides. Each step is a banded system, and is gone only as far as time
//! and deviation together become less.

use nalgebra::{Isometry3, Matrix3, Matrix6, Vector3, Vector6};
use nullsweep_robot::{Jacobian, JointVector};
use rayon::prelude::*;

use super::bend::{Bend, Offset};
use super::follow::onto;
use super::guard::Guard;
use super::piece::{Laid, Mean, Piece};
use super::window::Windows;
use crate::band::Band;
use crate::timing::{Limits, arrivals};
use crate::workcell::{Bed, Workcell};

/// What the pad may be off its averaged way: beside it on the surface \[m\], turned about its axis,
/// tilted \[rad\]. Where it is as much, that costs [`PRICE`].
const BESIDE: f64 = 0.012;
const TURNED: f64 = 1.0;
const TILTED: f64 = 0.06;
/// Off the surface: it is laid onto it again. \[m\]
const OFF: f64 = 0.0005;
/// The joints off their average, where they are to stay near it. \[rad\] or \[m\]
const ASIDE: f64 = 0.2;
/// Time that a deviation may cost along the way. \[s/m\]
const PRICE: f64 = 0.3;
/// Power to which shares of limits count.
const POWER: f64 = 6.0;
/// Most steps, and halvings of one.
const STEPS: usize = 30;
const HALVINGS: usize = 3;
/// The farthest that a joint's offset goes in one step. \[rad\] or \[m\]
const FARTHEST: f64 = 0.08;
/// A step that wins less than this share of the time is the last.
const WORTH: f64 = 5e-4;
/// How near a joint may come to its margins. \[rad\] or \[m\]
const MARGIN: f64 = 0.01;
/// Weight of what passes that. \[s/rad²\]
const BARRIER: f64 = 1e3;
/// Weight of what the pad is to come over and misses. \[s/m²\]
const MISSED: f64 = 1e5;
/// Less room than this is none.
const LEAST_ROOM: f64 = 0.05;

/// What a piece is bent within.
pub(super) struct Relaxation<'a> {
    pub(super) piece: &'a Piece,
    pub(super) windows: &'a Windows,
    pub(super) cell: Workcell<'a>,
    pub(super) bed: &'a Bed,
    pub(super) limits: &'a Limits,
    /// What the pad must come over.
    pub(super) guards: &'a [Guard],
}

/// A bent piece as it is gone along.
struct Way {
    bend: Bend,
    q: Vec<JointVector>,
    /// When the fastest motion is there. \[s\]
    times: Vec<f64>,
    /// Its time and what its deviations cost. \[s\]
    merit: f64,
}

impl Relaxation<'_> {
    /// The bend that a bend becomes, and how much less time the piece takes then than without one \[s\];
    /// `None` where the arm cannot follow the one that it is.
    pub(super) fn relaxed(&self, mut bend: Bend) -> Option<(Bend, f64)> {
        for control in 0..bend.controls.len() {
            if self.windows.room(bend.middle(control)) < LEAST_ROOM {
                bend.straighten(control);
            }
        }
        let count = self.piece.steps();
        let at = |k: usize| self.piece.length() * k as f64 / count as f64;
        let nodes: Vec<(f64, Mean)> =
            (0..=count).map(|k| (at(k), self.piece.mean(at(k), self.windows.at(at(k))))).collect();
        let plain = self.way(&nodes, Bend::none(self.piece.length()))?;
        let mut way = self.way(&nodes, bend)?;
        for _ in 0..STEPS {
            let step = self.step(&nodes, &way);
            let mut times = 1.0;
            let mut next = None;
            for _ in 0..=HALVINGS {
                let mut bend = way.bend.clone();
                for (control, step) in bend.controls.iter_mut().zip(&step) {
                    *control = control.plus(step, times);
                }
                next = self.way(&nodes, bend).filter(|next| next.merit < way.merit);
                if next.is_some() {
                    break;
                }
                times *= 0.5;
            }
            let Some(next) = next else { break };
            let is_worth = next.merit < way.merit * (1.0 - WORTH);
            way = next;
            if !is_worth {
                break;
            }
        }
        let won = plain.times.last()? - way.times.last()?;
        Some((way.bend, won))
    }

    /// The arm brought onto a bent piece.
    fn way(&self, nodes: &[(f64, Mean)], bend: Bend) -> Option<Way> {
        let moved: Vec<(f64, Mean)> =
            nodes.iter().map(|(u, mean)| (*u, mean.moved(&bend.at(*u)))).collect();
        let shifts = moved.par_iter().map(|(_, mean)| mean.laid(self.bed).unwrap_or(0.0)).collect();
        let laid = Laid::new(self.piece.length(), shifts);
        let there = |(u, mean): &(f64, Mean)| {
            let pose = mean.pose(laid.at(*u, self.windows.at(*u)))?;
            onto(self.cell, &pose, mean.q).filter(|q| self.cell.arm.within_margins(q))
        };
        let q: Vec<JointVector> = moved.par_iter().map(there).collect::<Option<_>>()?;
        if q.windows(2).any(|w| w[0] == w[1]) {
            return None;
        }
        let times = arrivals(&q, self.limits);
        let costs: f64 = (0..bend.controls.len()).map(|k| self.deviation(&bend, k)).sum();
        let pad = self.cell.tool.on(self.cell.arm);
        let short = |guard: &Guard| {
            let pose = pad.pose(&q[self.node(guard.u)]);
            guard.short(&pose, self.cell.tool).norm_squared()
        };
        let missed: f64 = self.guards.iter().map(short).sum();
        let merit = times.last()? + costs + MISSED * missed;
        merit.is_finite().then_some(Way { bend, q, times, merit })
    }

    /// What a control's deviation costs. \[s\]
    fn deviation(&self, bend: &Bend, control: usize) -> f64 {
        let (room, price) = self.price(bend, control);
        let Offset { q, twist } = bend.controls[control];
        let pad = self.stiffness(bend.middle(control), room);
        let joints: f64 = q.iter().map(|q| q * q).sum();
        price * ((twist.transpose() * pad * twist)[0] + joints * aside(room))
    }

    fn price(&self, bend: &Bend, control: usize) -> (f64, f64) {
        let room = self.windows.room(bend.middle(control)).max(LEAST_ROOM);
        (room, PRICE * bend.spacing())
    }

    /// The squares of a twist's parts against what the pad may be off, in the root frame.
    fn stiffness(&self, u: f64, room: f64) -> Matrix6<f64> {
        let into = self.piece.mean(u, self.windows.at(u)).axis();
        let normal = into * into.transpose();
        let beside = Matrix3::identity() - normal;
        let of = |along: f64, across: f64| {
            normal / (along * along) + beside / (across * room * across * room)
        };
        let mut all = Matrix6::zeros();
        all.fixed_view_mut::<3, 3>(0, 0).copy_from(&of(OFF, BESIDE));
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&of(TURNED * room, TILTED));
        all
    }

    /// Where the offsets are to go: the step of Newton's method.
    fn step(&self, nodes: &[(f64, Mean)], way: &Way) -> Vec<Offset> {
        let dof = self.cell.arm.limits().len();
        let controls = way.bend.controls.len();
        let size = controls * dof;
        let mut matrix = Band::zero(size, (CONTROLS * dof).max(1));
        let mut right = vec![0.0; size];
        for k in 1..nodes.len().saturating_sub(1) {
            self.add_limits(
                way,
                [nodes[k - 1].0, nodes[k].0, nodes[k + 1].0],
                k,
                (&mut matrix, &mut right),
            );
        }
        let jacobians: Vec<Jacobian> =
            (0..controls).map(|c| self.jacobian(nodes, way, c)).collect();
        for (control, jacobian) in jacobians.iter().enumerate() {
            let (room, price) = self.price(&way.bend, control);
            let is_fixed = self.windows.room(way.bend.middle(control)) < LEAST_ROOM;
            let pad = self.stiffness(way.bend.middle(control), room) * price;
            let back = jacobian.transpose() * pad;
            let (square, pull) = (back * jacobian, back * way.bend.controls[control].twist);
            let q = way.q[self.nearest(&way.bend, control)];
            for j in 0..dof {
                let row = control * dof + j;
                for other in j..dof {
                    matrix.add(row, control * dof + other, square[(j, other)]);
                }
                let joint = price * aside(room);
                matrix.add(row, row, joint + if is_fixed { f64::MAX.sqrt() } else { 1e-9 });
                right[row] -= pull[j] + joint * way.bend.controls[control].q[j];
                let (lower, upper) = self.cell.arm.margined_limits()[j];
                let over = (q[j] - (upper - MARGIN)).max(0.0) + (q[j] - (lower + MARGIN)).min(0.0);
                if over != 0.0 {
                    matrix.add(row, row, BARRIER);
                    right[row] -= BARRIER * over;
                }
            }
        }
        self.add_guards(way, &jacobians, &mut matrix, &mut right);
        matrix.solve(&mut right);
        let most = right.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let scale = (FARTHEST / most).min(1.0);
        let offset = |control: usize| {
            let own = &right[control * dof..][..dof];
            let q = JointVector::from_fn(|j| own.get(j).map_or(0.0, |x| scale * x));
            let mut twist: Vector6<f64> =
                (0..dof).map(|j| jacobians[control].column(j) * q[j]).sum();
            // The pad is laid onto the surface again.
            let u = way.bend.middle(control);
            let into = self.piece.mean(u, self.windows.at(u)).axis();
            let shift: Vector3<f64> = twist.fixed_rows::<3>(0).into();
            twist.fixed_rows_mut::<3>(0).copy_from(&(shift - into * shift.dot(&into)));
            Offset { q, twist }
        };
        (0..controls).map(offset).collect()
    }

    /// Adds what the joints' velocities and accelerations at a node cost.
    fn add_limits(
        &self,
        way: &Way,
        places: [f64; 3],
        k: usize,
        (matrix, right): (&mut Band, &mut [f64]),
    ) {
        let dof = self.cell.arm.limits().len();
        let (before, after) = (way.times[k] - way.times[k - 1], way.times[k + 1] - way.times[k]);
        let both = before + after;
        let rates = [
            [-1.0 / both, 0.0, 1.0 / both],
            [2.0 / (before * both), -2.0 / (before * after), 2.0 / (after * both)],
        ];
        let first = way.bend.weights(places[0]).next().or(way.bend.weights(places[2]).next());
        let Some((first, _)) = first else { return };
        let mut weights = [[0.0; CONTROLS]; 2];
        for (place, s) in places.into_iter().zip(0..) {
            for (control, weight) in way.bend.weights(place) {
                for (of, rate) in weights.iter_mut().zip(&rates) {
                    of[control - first] += rate[s] * weight;
                }
            }
        }
        let around = &way.q[k - 1..=k + 1];
        let bounds = [&self.limits.velocity, &self.limits.acceleration];
        let share = |of: usize, j: usize| {
            let rate: f64 = (0..3).map(|s| rates[of][s] * around[s][j]).sum();
            if bounds[of][j] > 0.0 { rate / bounds[of][j] } else { 0.0 }
        };
        let shares: [Vec<f64>; 2] = [0, 1].map(|of| (0..dof).map(|j| share(of, j)).collect());
        let all: f64 = shares.iter().flatten().map(|s| libm::pow(s.abs(), POWER)).sum();
        // Time goes with the velocity, and with the root of the acceleration.
        for (of, worth) in [(0, 0.5), (1, 0.25)] {
            for j in 0..dof {
                let share = shares[of][j];
                let bound = bounds[of][j];
                let weight =
                    0.5 * both * worth * libm::pow(share.abs(), POWER - 2.0) / all.max(1e-9);
                if weight < 1e-9 || bound <= 0.0 {
                    continue;
                }
                for (a, own) in weights[of].iter().enumerate().filter(|(_, w)| **w != 0.0) {
                    let row = (first + a) * dof + j;
                    right[row] -= weight * share * own / bound;
                    let curve = (POWER - 1.0) * weight * own / (bound * bound);
                    for (b, other) in weights[of].iter().enumerate().skip(a) {
                        if *other != 0.0 {
                            matrix.add(row, (first + b) * dof + j, curve * other);
                        }
                    }
                }
            }
        }
    }

    fn nearest(&self, bend: &Bend, control: usize) -> usize {
        self.node(bend.middle(control))
    }

    /// The node nearest to a place.
    fn node(&self, u: f64) -> usize {
        let last = self.piece.steps();
        ((u / self.piece.length() * last as f64).round() as usize).min(last)
    }

    /// Adds what it costs that the pad does not come over what it must.
    fn add_guards(&self, way: &Way, jacobians: &[Jacobian], matrix: &mut Band, right: &mut [f64]) {
        let dof = self.cell.arm.limits().len();
        let pad = self.cell.tool.on(self.cell.arm);
        for guard in self.guards {
            let pose = pad.pose(&way.q[self.node(guard.u)]);
            let short = guard.short(&pose, self.cell.tool);
            for axis in 0..2 {
                if short[axis] == 0.0 {
                    continue;
                }
                let direction = pose.rotation * Vector3::ith(axis, 1.0);
                let slope = |control: usize, weight: f64| -> Vec<f64> {
                    let jacobian = &jacobians[control];
                    let along = |j: usize| jacobian.fixed_view::<3, 1>(0, j).dot(&direction);
                    (0..dof).map(|j| weight * along(j)).collect()
                };
                let slopes: Vec<(usize, Vec<f64>)> =
                    way.bend.weights(guard.u).map(|(c, weight)| (c, slope(c, weight))).collect();
                for (at, (control, own)) in slopes.iter().enumerate() {
                    for j in 0..dof {
                        let row = control * dof + j;
                        let pull = MISSED * own[j];
                        right[row] += pull * short[axis];
                        for (other, theirs) in &slopes[at..] {
                            for (i, slope) in theirs.iter().enumerate() {
                                let column = other * dof + i;
                                if column >= row {
                                    matrix.add(row, column, pull * slope);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// Of the pad's centre at a control.
    fn jacobian(&self, nodes: &[(f64, Mean)], way: &Way, control: usize) -> Jacobian {
        let near = self.nearest(&way.bend, control).min(nodes.len() - 1);
        let (tip, mut jacobian) = self.cell.arm.tip_pose_and_jacobian(&way.q[near]);
        let centre: Isometry3<f64> = tip * self.cell.tool.contact_in_tip();
        let arm = centre.translation.vector - tip.translation.vector;
        for mut column in jacobian.column_iter_mut() {
            let turn: Vector3<f64> = column.fixed_rows::<3>(3).into();
            let shift: Vector3<f64> = column.fixed_rows::<3>(0).into();
            column.fixed_rows_mut::<3>(0).copy_from(&(shift + turn.cross(&arm)));
        }
        jacobian
    }
}

/// Most controls that bend three nodes in a row.
const CONTROLS: usize = 5;

/// What the joints pay for being off their average: nothing where there is all the room.
fn aside(room: f64) -> f64 {
    (1.0 / (room * room) - 1.0) / (ASIDE * ASIDE)
}
