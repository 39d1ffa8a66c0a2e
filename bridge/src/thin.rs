//! Fewer points for the same motion: a message of thousands is a burden for a network, and a controller
//! interpolates by itself.

use nullsweep_robot::JointVector;

use crate::stream::Point;

/// Most points that are left out in a row.
const SPAN: usize = 64;

/// The points without those that the ones beside them explain to `within`: by the cubic through places
/// and velocities, or, where velocities do not count, by a straight line. First and last stay.
/// \[rad\] or \[m\]
#[must_use]
pub fn thin(points: &[Point], curved: bool, within: f64) -> Vec<Point> {
    let mut kept: Vec<Point> = points.first().copied().into_iter().collect();
    let mut from = 0;
    while from + 1 < points.len() {
        let last = (from + SPAN).min(points.len() - 1);
        let explained = |to: &usize| {
            let (a, b) = (&points[from], &points[*to]);
            points[from + 1..*to].iter().all(|p| differ(p, &between(a, b, p, curved)) <= within)
        };
        // The next one explains all that lies before it: nothing does.
        let mut to = from + 1;
        while to < last && explained(&(to + 1)) {
            to += 1;
        }
        kept.push(points[to]);
        from = to;
    }
    kept
}

/// Where the arm is at `p`'s time, between two points.
fn between(a: &Point, b: &Point, p: &Point, curved: bool) -> JointVector {
    let h = (b.after_ns - a.after_ns) as f64 * 1e-9;
    let u = (p.after_ns - a.after_ns) as f64 * 1e-9 / h;
    JointVector::from_fn(|j| {
        let d = b.q[j] - a.q[j];
        if !curved {
            return a.q[j] + u * d;
        }
        let (v0, v1) = (a.v[j] * h, b.v[j] * h);
        a.q[j] + u * (v0 + u * ((3.0 * d - 2.0 * v0 - v1) + u * (v0 + v1 - 2.0 * d)))
    })
}

fn differ(p: &Point, q: &JointVector) -> f64 {
    (0..q.len()).map(|j| (p.q[j] - q[j]).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(count: u64, at: impl Fn(f64) -> (f64, f64)) -> Vec<Point> {
        let point = |i: u64| {
            let (q, v) = at(i as f64 * 0.01);
            let one = |x: f64| JointVector::from_fn(|j| if j == 2 { x } else { 0.0 });
            Point { after_ns: i * 10_000_000, q: one(q), v: one(v) }
        };
        (0..count).map(point).collect()
    }

    /// The largest distance of a point from the motion through the kept ones.
    fn off(points: &[Point], kept: &[Point], curved: bool) -> f64 {
        let mut most = 0.0_f64;
        for p in points {
            let i = kept.partition_point(|k| k.after_ns <= p.after_ns).clamp(1, kept.len() - 1);
            most = most.max(differ(p, &between(&kept[i - 1], &kept[i], p, curved)));
        }
        most
    }

    #[test]
    fn what_the_others_explain_is_left_out_and_no_more() {
        let wave = sampled(1001, |t| (t.sin(), t.cos()));
        for within in [1e-3, 1e-5] {
            let kept = thin(&wave, true, within);
            assert!(off(&wave, &kept, true) <= within * 1.0001);
            assert!(kept.len() < 100, "{}", kept.len());
            assert_eq!((kept.first(), kept.last()), (wave.first(), wave.last()));
        }
        // A line, a corner, and a line.
        let corner = sampled(101, |t| ((t - 0.5).abs(), 9.0));
        let kept = thin(&corner, false, 1e-9);
        assert!(kept.iter().any(|p| p.q[2] < 1e-9), "the corner stays");
        assert!(off(&corner, &kept, false) <= 1e-9 && kept.len() <= 5, "{}", kept.len());
        assert_eq!(thin(&wave[..1], true, 1e-3).len(), 1);
        assert!(thin(&[], true, 1e-3).is_empty());
    }
}
