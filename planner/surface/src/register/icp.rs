//! From coarse to fine, from several starts.

use nalgebra::{Isometry3, Point3, SymmetricEigen, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::cloud::Cloud;
use super::pairs::{Fit, Metric};
use super::result::{FARTHEST, HOLD, OVERLAP, RESIDUAL, RegisterError, Registration};
use crate::scan::View;

/// A counterpart lies at most this far away. \[m\]
const COUNTERPART: f64 = 0.02;

/// A level that goes across the surface: how far a counterpart may be, and the side of the voxels that
/// the clouds are thinned to. \[m\]
struct Coarse {
    reach: f64,
    voxel: f64,
}

/// From coarse to fine, from every start.
const COARSE: [Coarse; 3] = [
    Coarse { reach: 0.20, voxel: 0.030 },
    Coarse { reach: 0.10, voxel: 0.020 },
    Coarse { reach: 0.05, voxel: 0.012 },
];
/// Steps on each such level, at most.
const STEPS: usize = 25;
/// Coarse results that are refined.
const CANDIDATES: usize = 4;
/// How many points of each side look for a counterpart where a result is refined, and in how many
/// steps at most: what looks alike across the surface is told apart along it.
const FINE: [(usize, usize); 2] = [(2_000, 100), (MOST, 300)];
/// How far that counterpart may be. \[m\]
const FINE_REACH: f64 = 0.05;
/// Points of the view by which the result is judged.
const MOST: usize = 6_000;
/// Points of each side among which counterparts are looked for.
const DENSE: usize = 60_000;

/// Lays a view onto others.
///
/// # Errors
/// [`RegisterError`] with the figures of the best fit where that is not to be trusted.
pub fn register(others: &[View], view: &View) -> Result<Registration, RegisterError> {
    let view = std::slice::from_ref(view);
    let coarse: Vec<[Cloud; 2]> =
        COARSE.iter().map(|l| [others, view].map(|v| Cloud::coarse(v, l.voxel))).collect();
    let [target, moving] = &[others, view].map(|views| Cloud::fine(views, DENSE));
    let middle = middle(&moving.points);
    let last = &COARSE[COARSE.len() - 1];
    let mut found: Vec<(Isometry3<f64>, f64)> = starts(&middle)
        .into_par_iter()
        .map(|start| {
            let pose = coarse.iter().zip(&COARSE).fold(start, |pose, ([target, moving], level)| {
                let fit = |pose: &_| Fit::new(target, moving, pose, level.reach, usize::MAX);
                descend(fit, Metric::Across, STEPS, pose, &middle)
            });
            let [target, moving] = &coarse[coarse.len() - 1];
            (pose, Fit::new(target, moving, &pose, last.reach, usize::MAX).score())
        })
        .collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    found.dedup_by(|a, b| is_same(&a.0, &b.0, &middle));
    found.truncate(CANDIDATES);
    let fine: Vec<(Isometry3<f64>, f64)> = found
        .into_par_iter()
        .map(|(start, _)| {
            let pose = FINE.iter().fold(start, |pose, (most, steps)| {
                let fit = |pose: &_| Fit::both(target, moving, pose, FINE_REACH, *most);
                descend(fit, Metric::Noise, *steps, pose, &middle)
            });
            (pose, Fit::new(target, moving, &pose, COUNTERPART, MOST).apart())
        })
        .collect();
    let best = fine.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let correction = best.map_or_else(Isometry3::identity, |best| best.0);
    let found = figures(target, moving, &correction, &middle);
    if found.overlap < OVERLAP {
        Err(RegisterError::Overlap { found })
    } else if found.residual > RESIDUAL {
        Err(RegisterError::Residual { found })
    } else if found.hold < HOLD {
        Err(RegisterError::Slides { found })
    } else if found.moved > FARTHEST.0 || found.turned > FARTHEST.1 {
        Err(RegisterError::TooFar { found })
    } else {
        Ok(found)
    }
}

/// Where the search starts: as given, and moved and turned a little about the view's middle.
fn starts(middle: &Point3<f64>) -> Vec<Isometry3<f64>> {
    const ASIDE: f64 = 0.08;
    const TURN: f64 = 0.08;
    let about = |shift: Vector3<f64>, turn: Vector3<f64>| {
        let turn = UnitQuaternion::from_scaled_axis(turn);
        let there = Translation3::from(middle.coords);
        Translation3::from(shift) * there * turn * there.inverse()
    };
    let mut starts = vec![Isometry3::identity()];
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let unit = Vector3::ith(axis, sign);
            starts.push(about(unit * ASIDE, Vector3::zeros()));
            starts.push(about(Vector3::zeros(), unit * TURN));
        }
    }
    for i in 0..8 {
        let sign = |bit: i32| if i >> bit & 1 == 0 { 0.6 } else { -0.6 };
        let corner = Vector3::new(sign(0), sign(1), sign(2));
        starts.push(about(corner * (1.4 * ASIDE), Vector3::zeros()));
    }
    starts
}

fn middle(points: &[Point3<f64>]) -> Point3<f64> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    Point3::from(sum / points.len().max(1) as f64)
}

/// Whether two poses of a view are one for what follows: 2 mm at its middle, 0.3°.
fn is_same(a: &Isometry3<f64>, b: &Isometry3<f64>, middle: &Point3<f64>) -> bool {
    let turned = (a.rotation.inverse() * b.rotation).angle();
    (a * middle - b * middle).norm() < 0.002 && turned < 0.005
}

/// Goes down a level from a start.
fn descend(
    fit: impl Fn(&Isometry3<f64>) -> Fit,
    metric: Metric,
    steps: usize,
    start: Isometry3<f64>,
    middle: &Point3<f64>,
) -> Isometry3<f64> {
    let mut pose = start;
    for _ in 0..steps {
        let fit = fit(&pose);
        if fit.pairs.len() < 20 {
            break;
        }
        let there = pose * middle;
        let (mut matrix, right, total) = fit.equations(&there, 1.0, metric);
        // A trace of damping keeps what slides in place.
        let most = matrix.diagonal().max().max(total).max(1.0);
        for i in 0..6 {
            matrix[(i, i)] += 1e-6 * most;
        }
        let Some(step) = matrix.cholesky().map(|c| c.solve(&right)) else { break };
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        let shift = Translation3::from(step.fixed_rows::<3>(3).into_owned());
        let centre = Translation3::from(there.coords);
        pose = shift * centre * turn * centre.inverse() * pose;
        if step.norm() < 1e-6 {
            break;
        }
    }
    pose
}

fn figures(
    target: &Cloud,
    moving: &Cloud,
    correction: &Isometry3<f64>,
    middle: &Point3<f64>,
) -> Registration {
    let fit = Fit::new(target, moving, correction, COUNTERPART, MOST);
    let before = Fit::new(target, moving, &Isometry3::identity(), COUNTERPART, MOST);
    let there = correction * middle;
    let apart = moving.points.iter().map(|p| (p - middle).norm_squared()).sum::<f64>();
    let size = (apart / moving.points.len().max(1) as f64).sqrt().max(1e-3);
    let (matrix, _, total) = fit.equations(&there, size, Metric::Across);
    let least = SymmetricEigen::new(matrix / total.max(1e-9)).eigenvalues.min();
    let overlap = |fit: &Fit| fit.pairs.len() as f64 / fit.of.max(1) as f64;
    Registration {
        correction: *correction,
        moved: (there - middle).norm(),
        turned: correction.rotation.angle(),
        overlap: overlap(&fit),
        overlap_before: overlap(&before),
        residual: fit.residual(),
        residual_before: before.residual(),
        hold: least.max(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::{Placement, place};
    use crate::simulate;

    /// Two views of the simulated chair, from places 0.3 m apart, each with noise of its own.
    fn views() -> [View; 2] {
        simulate::chair_twice(3).map(|seen| {
            let (placed, _) = place(&seen.scan, &Placement::SensorPose(seen.sensor_pose));
            placed.views.into_iter().next().expect("one view")
        })
    }

    fn moved(view: &View, pose: &Isometry3<f64>) -> View {
        View {
            points: view.points.iter().map(|p| pose * p).collect(),
            sensor: view.sensor.map(|s| pose * s),
            ..View::default()
        }
    }

    #[test]
    fn a_view_that_is_off_is_laid_onto_the_other() {
        let [one, two] = views();
        for (shift, turn) in [
            (Vector3::new(0.03, -0.03, 0.02), Vector3::new(0.02, 0.0, 0.08)),
            (Vector3::new(-0.05, 0.0, 0.0), Vector3::new(0.0, -0.08, 0.02)),
        ] {
            let off = Isometry3::new(shift, turn);
            let found = register(std::slice::from_ref(&one), &moved(&two, &off)).unwrap();
            let left = found.correction * off;
            let middle = middle(&two.points);
            assert!((left * middle - middle).norm() < 0.003, "{left}");
            assert!(left.rotation.angle() < 0.0052, "{left}");
            assert!(found.is_needed() && found.overlap > 0.5, "{found:?}");
        }
        let right = register(std::slice::from_ref(&one), &two).unwrap();
        assert!(!right.is_needed(), "{right:?}");
    }

    #[test]
    fn what_is_not_to_be_trusted_is_refused_with_figures() {
        let [one, two] = views();
        let far = moved(&two, &Isometry3::translation(2.0, 0.0, 0.0));
        let error = register(std::slice::from_ref(&one), &far).unwrap_err();
        assert!(matches!(error, RegisterError::Overlap { .. }), "{error}");
        assert!(error.to_string().contains("only 0 % of the view"), "{error}");
        // A plate slides over itself.
        let at = |i: usize| 0.004 * i as f64;
        let plate = View {
            points: (0..120 * 120).map(|i| Point3::new(at(i % 120), at(i / 120), 0.5)).collect(),
            sensor: Some(Point3::new(0.2, 0.2, 2.0)),
            ..View::default()
        };
        let error = register(std::slice::from_ref(&plate), &plate).unwrap_err();
        assert!(matches!(error, RegisterError::Slides { .. }), "{error}");
    }

    #[test]
    fn no_cloud_at_all_is_refused() {
        let empty = View::default();
        assert!(register(&[], &empty).is_err());
    }
}
