//! The fastest way along a smooth path under limits of velocity and acceleration.
//!
//! Reachability analysis as in TOPP-RA (Pham and Pham, 2018), with x = ṡ² on a grid and s̈ = u
//! constant between two grid points, so that x is linear in s there. On a quadratic piece a
//! joint's acceleration q'u + q''x is then linear in s too: bounds that hold at both ends of an
//! interval hold everywhere in it, and no joint ever leaves its limit between grid points. Both
//! ends' bounds are inequalities in the values of x at these ends.

use nullsweep_robot::{JointVector, MAX_DOF};

use super::Limits;

/// What lies between two grid points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    /// Range of s.
    pub(super) length: f64,
    /// dq/ds at its start.
    pub(super) slope: JointVector,
    /// d²q/ds².
    pub(super) bend: JointVector,
    /// Share of the limits that may be used, 0…1.
    pub(super) share: f64,
    /// The greatest x at its start and its end for another reason.
    pub(super) caps: [f64; 2],
}

/// x = ṡ² at each grid point of the fastest motion that starts with `start` and ends at rest;
/// `None` where that start is too fast to come to rest on this path.
pub(super) fn squared_speeds(
    intervals: &[Interval],
    limits: &Limits,
    start: f64,
) -> Option<Vec<f64>> {
    let count = intervals.len();
    let mut most = vec![0.0; count + 1];
    // Backwards: the greatest x from which the end can be reached.
    for i in (0..count).rev() {
        let rows = Rows::new(&intervals[i], limits);
        let cap = speed_cap(&intervals[i], limits, 0.0);
        let before = i
            .checked_sub(1)
            .map_or(f64::INFINITY, |b| speed_cap(&intervals[b], limits, intervals[b].length));
        most[i] = rows.most_before(cap.min(before), most[i + 1]);
    }
    if start > most[0] * (1.0 + START_SLACK) {
        return None;
    }
    // Forwards: as fast as these allow.
    let mut x = vec![start.min(most[0])];
    for i in 0..count {
        let rows = Rows::new(&intervals[i], limits);
        x.push(rows.most_after(x[i], most[i + 1]));
    }
    Some(x)
}

/// How much above what can be braked a start may be, as rounding makes it.
const START_SLACK: f64 = 1e-6;
/// An interval is crossed in less than this even where nothing limits its speed. \[s\]
const SHORTEST: f64 = 1e-6;

/// The greatest x at `s` of an interval under the velocity limits.
fn speed_cap(interval: &Interval, limits: &Limits, s: f64) -> f64 {
    let own = interval.caps[usize::from(s > 0.0)];
    let mut cap = (interval.length / SHORTEST).powi(2).min(own);
    for j in 0..MAX_DOF {
        let slope = (interval.slope[j] + s * interval.bend[j]).abs();
        if slope > 0.0 && limits.velocity[j] > 0.0 {
            cap = cap.min((interval.share * limits.velocity[j] / slope).powi(2));
        }
    }
    cap
}

/// |a·x + b·y| ≤ 1 for x at the interval's start and y at its end: two rows a joint.
struct Rows {
    rows: [(f64, f64); 2 * MAX_DOF],
    count: usize,
}

impl Rows {
    fn new(interval: &Interval, limits: &Limits) -> Self {
        let mut rows = [(0.0, 0.0); 2 * MAX_DOF];
        let mut count = 0;
        let half = 0.5 / interval.length;
        for j in 0..MAX_DOF {
            let limit = limits.acceleration[j] * interval.share;
            if limit <= 0.0 {
                continue;
            }
            // u = (y − x) / 2Δ.
            let (slope, bend) = (interval.slope[j], interval.bend[j]);
            let end = slope + interval.length * bend;
            rows[count] = ((bend - slope * half) / limit, slope * half / limit);
            rows[count + 1] = (-end * half / limit, (bend + end * half) / limit);
            count += 2;
        }
        Self { rows, count }
    }

    /// The values of y that fit an x, and the rows that bound them below and above.
    fn range(&self, x: f64, top: f64) -> (f64, f64, Option<usize>, Option<usize>) {
        let (mut low, mut high) = (0.0, top);
        let (mut below, mut above) = (None, None);
        for (i, &(a, b)) in self.rows[..self.count].iter().enumerate() {
            if b.abs() < TINY {
                continue;
            }
            let (p, q) = ((-1.0 - a * x) / b, (1.0 - a * x) / b);
            let (l, h) = if b > 0.0 { (p, q) } else { (q, p) };
            if l > low {
                (low, below) = (l, Some(i));
            }
            if h < high {
                (high, above) = (h, Some(i));
            }
        }
        (low, high, below, above)
    }

    /// The greatest x up to `cap` for which some y up to `top` fits.
    fn most_before(&self, cap: f64, top: f64) -> f64 {
        let mut x = cap;
        for &(a, b) in &self.rows[..self.count] {
            if b.abs() < TINY && a.abs() > TINY {
                x = x.min(1.0 / a.abs());
            }
        }
        // The lowest y that fits is convex in x, the highest concave: from the right, a step to
        // where the two binding lines meet never passes the greatest x at which both agree.
        for _ in 0..STEPS {
            let (low, high, below, above) = self.range(x, top);
            if low <= high {
                return x;
            }
            let line = |row: Option<usize>, value: f64, upper: bool| match row {
                None => (0.0, if upper { top } else { 0.0 }),
                Some(i) => {
                    let slope = -self.rows[i].0 / self.rows[i].1;
                    (slope, value - slope * x)
                }
            };
            let ((ml, cl), (mh, ch)) = (line(below, low, false), line(above, high, true));
            let next = (ch - cl) / (ml - mh);
            if next < x {
                x = next.max(0.0);
            } else {
                // Rounding: the lines meet here.
                x *= 1.0 - 1e-12;
            }
        }
        // Rounding may leave a gap of a few ulp: a little less speed fits.
        while x > 0.0 {
            let (low, high, ..) = self.range(x, top);
            if low <= high {
                return x;
            }
            x = if x < 1e-18 { 0.0 } else { x * (1.0 - 1e-9) - 1e-18 };
        }
        0.0
    }

    /// The greatest y up to `top` that fits an x.
    fn most_after(&self, x: f64, top: f64) -> f64 {
        let (low, high, ..) = self.range(x, top);
        // Within what rounding can do, `low` is `high`.
        high.max(low.min(top)).max(0.0)
    }
}

/// Coefficients below this bound nothing.
const TINY: f64 = 1e-300;
/// Steps of the search for the greatest x; each one retires a row.
const STEPS: usize = 4 * MAX_DOF;

#[cfg(test)]
mod tests {
    use super::*;

    fn lane(values: &[f64]) -> JointVector {
        let mut all = [0.0; MAX_DOF];
        all[..values.len()].copy_from_slice(values);
        JointVector::new(all)
    }

    fn time(intervals: &[Interval], x: &[f64]) -> f64 {
        let of = |i: usize| 2.0 * intervals[i].length / (x[i].sqrt() + x[i + 1].sqrt());
        (0..intervals.len()).map(of).sum()
    }

    /// Two joints along q = (s, c s²/2), cut evenly.
    fn bow(length: f64, bend: f64, count: usize) -> Vec<Interval> {
        let step = length / count as f64;
        (0..count)
            .map(|i| Interval {
                length: step,
                slope: lane(&[1.0, bend * step * i as f64]),
                bend: lane(&[0.0, bend]),
                share: 1.0,
                caps: [f64::INFINITY; 2],
            })
            .collect()
    }

    #[test]
    fn a_straight_line_takes_the_time_of_its_trapezoid() {
        let limits = Limits { velocity: lane(&[2.0, 9.0]), acceleration: lane(&[4.0, 9.0]) };
        // D/v + v/a, and 2 √(D/a) where the top speed is not reached.
        for (length, exact) in [(3.0, 3.0 / 2.0 + 2.0 / 4.0), (0.5, 2.0 * (0.5f64 / 4.0).sqrt())] {
            for count in [20, 100] {
                let line = bow(length, 0.0, count);
                let x = squared_speeds(&line, &limits, 0.0).expect("from rest");
                let found = time(&line, &x);
                assert!(found > exact * (1.0 - 1e-9), "{found} beats {exact}");
                assert!(found < exact * 1.005, "{count}: {found} for {exact}");
            }
        }
    }

    /// The same by integration of the phase plane: at each speed the greatest s̈, forwards from
    /// the start and backwards from the end, under the curve of greatest speed.
    #[test]
    fn a_bow_takes_the_time_that_the_phase_plane_gives() {
        let (length, bend) = (1.5, 2.0);
        let limits = Limits { velocity: lane(&[2.0, 2.2]), acceleration: lane(&[3.0, 4.0]) };
        let line = bow(length, bend, 400);
        let x = squared_speeds(&line, &limits, 0.0).expect("from rest");
        let found = time(&line, &x);

        // The path from end to start is the same with s reversed: mirror it for the way back.
        let greatest = |s: f64, x: f64, sign: f64| {
            // |sign·u| ≤ 3 and |bend s · u + bend x| ≤ 4, with u along the direction of travel.
            let mut u = limits.acceleration[0];
            let slope = bend * s;
            if slope > 0.0 {
                let bound = (limits.acceleration[1] - sign * bend * x) / slope;
                u = u.min(bound);
            }
            u
        };
        let cap = |s: f64| {
            let v = limits.velocity[0].min(limits.velocity[1] / (bend * s).max(1e-12));
            // Some u must fit: |u| ≤ 3 and |bend s u + bend x| ≤ 4.
            let most = (limits.acceleration[1] + bend * s * limits.acceleration[0]) / bend;
            (v * v).min(most)
        };
        let count = 200_000;
        let step = length / count as f64;
        let mut forward = vec![0.0f64; count + 1];
        let mut backward = vec![0.0f64; count + 1];
        for i in 0..count {
            let s = i as f64 * step;
            let next = forward[i] + 2.0 * step * greatest(s, forward[i], 1.0);
            forward[i + 1] = next.min(cap(s + step));
        }
        for i in (0..count).rev() {
            let s = (i + 1) as f64 * step;
            let next = backward[i + 1] + 2.0 * step * greatest(s, backward[i + 1], -1.0);
            backward[i] = next.min(cap(i as f64 * step));
        }
        let fast: Vec<f64> = (0..=count).map(|i| forward[i].min(backward[i])).collect();
        let exact: f64 =
            (0..count).map(|i| 2.0 * step / (fast[i].sqrt() + fast[i + 1].sqrt())).sum();
        assert!((found / exact - 1.0).abs() < 0.003, "{found} against {exact}");
    }

    #[test]
    fn a_start_that_cannot_be_braked_is_refused() {
        let limits = Limits { velocity: lane(&[2.0]), acceleration: lane(&[4.0]) };
        let line = bow(0.1, 0.0, 10);
        // v² = 2 a s.
        assert!(squared_speeds(&line, &limits, 0.81).is_none());
        let x = squared_speeds(&line, &limits, 0.79).expect("it can be braked");
        assert_eq!((x[0], x[10]), (0.79, 0.0));
    }
}
