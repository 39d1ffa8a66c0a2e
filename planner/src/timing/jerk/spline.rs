//! Even steps of time through a reference, as a cubic B-spline.

use nullsweep_robot::{JointVector, MAX_DOF};

use super::super::Limits;
use super::super::sampled::Timed;
use super::reference::Place;

/// A uniform cubic B-spline in time.
pub(super) struct Spline {
    points: Vec<JointVector>,
    /// Where on the reference each control point lies, in nodes.
    places: Vec<f64>,
    step_ns: u64,
}

/// A cubic B-spline's weights at a share of the way from its second point to its third, and what
/// they are for values along a grid.
fn at<V, T>(values: &[V], place: f64, zero: T, add: impl Fn(T, &V, f64) -> T) -> T {
    let last = values.len() - 1;
    let k = (place.max(0.0) as usize).min(last.saturating_sub(1));
    let u = (place - k as f64).clamp(0.0, 1.0);
    let weights = [
        (1.0 - u).powi(3) / 6.0,
        (3.0 * u.powi(3) - 6.0 * u * u + 4.0) / 6.0,
        (-3.0 * u.powi(3) + 3.0 * u * u + 3.0 * u + 1.0) / 6.0,
        u.powi(3) / 6.0,
    ];
    let mut sum = zero;
    for (i, weight) in weights.into_iter().enumerate() {
        sum = add(sum, &values[(k + i).saturating_sub(1).min(last)], weight);
    }
    sum
}

/// A stretch that exceeds the limits.
pub(super) struct Excess {
    /// Where on the reference, in nodes.
    pub(super) from: f64,
    pub(super) to: f64,
    /// By what factor on speed.
    pub(super) factor: f64,
}

impl Spline {
    /// Through a reference whose nodes are `step` \[s\] apart, by the squared pace at each.
    pub(super) fn along(reference: &[Place], squared: &[f64], step: f64, step_ns: u64) -> Self {
        let last = (reference.len() - 1) as f64;
        let pace = |place: f64| {
            at(squared, place.clamp(0.0, last), 0.0, |sum, b, weight| sum + weight * b).sqrt()
                / step
        };
        let h = step_ns as f64 * 1e-9;
        let position = |place: f64| {
            // About one of the places, so that equal ones give that very one.
            let origin = reference[(place as usize).min(reference.len() - 1)].q;
            let sum = at(reference, place, JointVector::ZERO, |sum, p, weight| {
                JointVector::from_fn(|j| sum[j] + weight * (p.q[j] - origin[j]))
            });
            origin + sum
        };
        let (first, end) = (reference[0].q, reference[reference.len() - 1].q);
        let mut points = vec![first; 3];
        let mut places = vec![0.0; 3];
        let mut place = 0.0;
        while place < last {
            let a = pace(place);
            let b = pace(place + 0.5 * h * a);
            let c = pace(place + 0.5 * h * b);
            let d = pace(place + h * c);
            place += h * (a + 2.0 * b + 2.0 * c + d) / 6.0;
            places.push(place.min(last));
            points.push(position(place.min(last)));
        }
        points.extend([end; 3]);
        places.extend([last; 3]);
        // What stands still at both ends takes no time.
        let still = |p: &&JointVector, of: &JointVector| **p == *of;
        let front = points.iter().take_while(|p| still(p, &first)).count().saturating_sub(3);
        let back = points.iter().rev().take_while(|p| still(p, &end)).count().saturating_sub(3);
        let kept = front..points.len() - back;
        Self { points: points[kept.clone()].to_vec(), places: places[kept].to_vec(), step_ns }
    }

    /// How long it takes. \[s\]
    pub(super) fn seconds(&self) -> f64 {
        self.points.len().saturating_sub(3) as f64 * self.step()
    }

    fn step(&self) -> f64 {
        self.step_ns as f64 * 1e-9
    }

    /// Where the limits are exceeded.
    pub(super) fn excess(&self, limits: &Limits, jerk: &JointVector) -> Vec<Excess> {
        let h = self.step();
        let mut found = Vec::new();
        for (w, places) in self.points.windows(4).zip(self.places.windows(4)) {
            let mut most = 0.0f64;
            for j in 0..MAX_DOF {
                if limits.velocity[j] <= 0.0 {
                    continue;
                }
                let differences: [f64; 3] = std::array::from_fn(|k| (w[k + 1][j] - w[k][j]) / h);
                let velocity = differences.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
                let accelerations =
                    [0, 1].map(|k: usize| (differences[k + 1] - differences[k]) / h);
                let acceleration = accelerations[0].abs().max(accelerations[1].abs());
                let third = (accelerations[1] - accelerations[0]).abs() / h;
                most = most.max(velocity / limits.velocity[j]);
                most = most.max((acceleration / limits.acceleration[j]).sqrt());
                most = most.max(libm::cbrt(third / jerk[j]));
            }
            if most > 1.0 {
                found.push(Excess { from: places[0], to: places[3], factor: most });
            }
        }
        found
    }

    /// The same, so much slower.
    pub(super) fn slowed(self, factor: f64) -> Self {
        let step_ns = (self.step_ns as f64 * factor * (1.0 + 1e-7)).ceil() as u64;
        Self { step_ns: if factor > 1.0 { step_ns } else { self.step_ns }, ..self }
    }

    /// Its knots, with what the reference's places say of where they come from.
    pub(super) fn knots(&self, from_ns: u64, reference: &[Place]) -> Vec<Timed> {
        let h = self.step();
        let source = |place: f64| {
            let k = (place as usize).min(reference.len() - 1);
            let next = reference[(k + 1).min(reference.len() - 1)].source;
            let here = reference[k].source;
            here + (place - k as f64) * (next - here)
        };
        let inner = self.points.windows(3).zip(&self.places[1..]).enumerate();
        inner
            .map(|(k, (w, place))| {
                let [a, b, c] = [&w[0], &w[1], &w[2]];
                Timed {
                    time_ns: from_ns + k as u64 * self.step_ns,
                    q: JointVector::from_fn(|j| b[j] + ((a[j] - b[j]) + (c[j] - b[j])) / 6.0),
                    v: JointVector::from_fn(|j| (c[j] - a[j]) / (2.0 * h)),
                    source: source(*place),
                }
            })
            .collect()
    }
}
