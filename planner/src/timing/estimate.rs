//! When the fastest motion along a path comes to each of its points.

use nullsweep_robot::JointVector;

use super::Limits;
use super::optimal::squared_speeds;
use super::sampled::{cells, intervals};
use super::smooth::smooth;

/// Time of each point of a path that is gone along from rest to rest as fast as velocity and
/// acceleration allow, its corners as round as they can be: a quadratic B-spline. \[s\] What cubics
/// between knots, whole nanoseconds and collisions take besides is not counted. No two points in a
/// row may be equal.
#[must_use]
pub fn arrivals(points: &[JointVector], limits: &Limits) -> Vec<f64> {
    let mut times = vec![0.0; points.len()];
    let mut time = 0.0;
    for run in smooth(points, &|_, _| true) {
        let cells = cells(&run);
        let intervals = intervals(&cells, 1.0, &|_, _, _| f64::INFINITY);
        // Rest is where every path can be left from.
        let Some(x) = squared_speeds(&intervals, limits, 0.0) else { continue };
        for (cell, x) in cells.iter().zip(x.windows(2)) {
            time += 2.0 * cell.piece.length / (x[0].sqrt() + x[1].sqrt());
            let [_, end] = cell.piece.source;
            if end.fract() == 0.0 {
                times[end as usize] = time;
            }
        }
    }
    times
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::MAX_DOF;

    use super::*;

    #[test]
    fn a_line_takes_the_time_of_its_trapezoid_whatever_lies_on_it() {
        let limits = Limits {
            velocity: JointVector::from_fn(|_| 2.0),
            acceleration: JointVector::from_fn(|_| 4.0),
        };
        let at = |x: f64| JointVector::from_fn(|j| if j < MAX_DOF { x } else { 0.0 });
        let points: Vec<JointVector> = (0..=300).map(|k| at(0.01 * f64::from(k))).collect();
        let times = arrivals(&points, &limits);
        // 3 rad: half a second to 2 rad/s, as long to rest, and 2 rad between.
        assert_eq!(times[0], 0.0);
        assert!((times[300] - 2.0).abs() < 0.01, "{}", times[300]);
        assert!((times[150] - 1.0).abs() < 0.01, "{}", times[150]);
        assert!((times[50] - 0.5).abs() < 0.01, "{}", times[50]);
        assert!(times.windows(2).all(|w| w[0] < w[1]));
    }
}
