//! A joint path with corners to smooth runs.

use nullsweep_robot::{JointVector, MAX_DOF};
use rayon::prelude::*;

use super::smooth_path::{Piece, SmoothPath};

/// Halvings of a blend until the arm stops in the corner instead.
const MAX_HALVINGS: u32 = 12;
/// A shorter blend would take less time than a cycle of the executor: stop instead. \[rad\]
const SHORTEST: f64 = 1e-5;

/// Blends each corner of a path by a parabola between the legs, both as long as half of the
/// shorter one where `fits` says so, else the longest that fits by halving; where none fits, a
/// run ends: the arm stops in the corner. Blends of corners that lie close together become one
/// smooth curve, the quadratic B-spline of the path's points.
///
/// `fits` is asked for the index of a point and the two halves of its blend, on several threads.
/// Between blends the path stays what it was. No two points in a row may be equal.
#[must_use]
pub fn smooth(
    points: &[JointVector],
    fits: &(dyn Fn(usize, &[Piece; 2]) -> bool + Sync),
) -> Vec<SmoothPath> {
    let legs: Vec<f64> = points.windows(2).map(|w| w[0].distance(&w[1])).collect();
    let blends: Vec<Option<[Piece; 2]>> = (0..points.len())
        .into_par_iter()
        .map(|i| {
            if i == 0 || i + 1 >= points.len() {
                return None;
            }
            let mut reach = 0.5 * legs[i - 1].min(legs[i]);
            for _ in 0..=MAX_HALVINGS {
                if reach < SHORTEST {
                    return None;
                }
                let halves = blend(points, &legs, i, reach);
                if fits(i, &halves) {
                    return Some(halves);
                }
                reach *= 0.5;
            }
            None
        })
        .collect();

    let mut runs = Vec::new();
    let mut run = SmoothPath::default();
    for i in 0..legs.len() {
        // From the end of the blend before to the start of the next one.
        let from = blends[i].as_ref().map_or(0.0, |b| b[1].length);
        let to = legs[i] - blends[i + 1].as_ref().map_or(0.0, |b| b[0].length);
        if to - from > 1e-9 * legs[i] {
            let line = Piece::line(&points[i], &points[i + 1], [i as f64, (i + 1) as f64]);
            run.pieces.push(line.part(from / legs[i], to / legs[i]));
        }
        match blends[i + 1] {
            Some(halves) => run.pieces.extend(halves),
            None => runs.push(std::mem::take(&mut run)),
        }
    }
    runs
}

/// The parabola around point `i`, from `reach` before it to `reach` after it, in two halves.
fn blend(points: &[JointVector], legs: &[f64], i: usize, reach: f64) -> [Piece; 2] {
    let unit = |a: &JointVector, b: &JointVector, length: f64| -> JointVector {
        JointVector::from_fn(|j| (b[j] - a[j]) / length)
    };
    let before = unit(&points[i - 1], &points[i], legs[i - 1]);
    let after = unit(&points[i], &points[i + 1], legs[i]);
    let at = i as f64;
    let whole = Piece {
        length: 2.0 * reach,
        start: JointVector::from_fn(|j| points[i][j] - reach * before[j]),
        slope: before,
        bend: JointVector::from_fn(|j| (after[j] - before[j]) / (2.0 * reach)),
        source: [at - reach / legs[i - 1], at],
    };
    let mut halves = [whole.part(0.0, 0.5), whole.part(0.5, 1.0)];
    halves[0].source = whole.source;
    halves[1].source = [at, at + reach / legs[i]];
    halves
}

/// How far the halves of a blend leave the corner that they cut, over all joints. \[rad\]
#[must_use]
pub(super) fn cut(halves: &[Piece; 2], corner: &JointVector) -> f64 {
    let middle = halves[1].start;
    (0..MAX_DOF).map(|j| (middle[j] - corner[j]).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> JointVector {
        let mut q = [0.0; MAX_DOF];
        (q[0], q[1]) = (x, y);
        JointVector::new(q)
    }

    #[test]
    fn runs_are_smooth_and_stay_near_the_path() {
        let points = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 0.5), at(0.2, 0.5), at(0.2, 0.4)];
        // The third corner fits nothing: a stop. The others may leave the corner by 0.02.
        let fits = |i: usize, halves: &[Piece; 2]| i != 2 && cut(halves, &points[i]) <= 0.02;
        let runs = smooth(&points, &fits);
        assert_eq!(runs.len(), 2);
        assert_eq!(runs[0].pieces[0].start, points[0]);
        let mut stops = Vec::new();
        for run in &runs {
            for pair in run.pieces.windows(2) {
                let (a, b) = (&pair[0], &pair[1]);
                assert!(a.at(a.length).distance(&b.start) < 1e-12);
                assert!(a.slope_at(a.length).distance(&b.slope) < 1e-12);
                assert!((a.source[1] - b.source[0]).abs() < 1e-12);
            }
            let last = run.pieces[run.pieces.len() - 1];
            stops.push(last.at(last.length));
            assert!(last.source[1] == 2.0 || last.source[1] == 4.0);
        }
        assert!(stops[0].distance(&points[2]) < 1e-12);
        assert!(stops[1].distance(&points[4]) < 1e-12);
        for piece in runs.iter().flat_map(|r| &r.pieces) {
            for k in 0..=8 {
                let q = piece.at(piece.length * f64::from(k) / 8.0);
                let off = points
                    .windows(2)
                    .map(|w| {
                        let leg = w[0].distance(&w[1]);
                        let along: f64 =
                            (0..2).map(|j| (q[j] - w[0][j]) * (w[1][j] - w[0][j])).sum();
                        let share = (along / (leg * leg)).clamp(0.0, 1.0);
                        let foot: JointVector =
                            JointVector::from_fn(|j| w[0][j] + share * (w[1][j] - w[0][j]));
                        q.distance(&foot)
                    })
                    .fold(f64::INFINITY, f64::min);
                assert!(off <= 0.02 + 1e-9, "{off} at {:?}", piece.source);
            }
        }
    }

    #[test]
    fn close_corners_become_one_curve() {
        let points: Vec<JointVector> = (0..20)
            .map(|k| {
                let angle = 0.1 * f64::from(k);
                at(libm::cos(angle), libm::sin(angle))
            })
            .collect();
        let runs = smooth(&points, &|_, _| true);
        assert_eq!(runs.len(), 1);
        // Straight bits are left only in the first and the last leg.
        let straight = runs[0].pieces.iter().filter(|p| p.bend == JointVector::ZERO).count();
        assert_eq!(straight, 2);
        // The circle's curvature is 1.
        for p in runs[0].pieces.iter().filter(|p| p.bend != JointVector::ZERO) {
            let bend = p.bend.distance(&JointVector::ZERO);
            assert!((bend - 1.0).abs() < 0.01, "{bend}");
        }
    }
}
