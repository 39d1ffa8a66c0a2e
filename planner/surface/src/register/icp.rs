//! From coarse to fine, from several starts.

use nalgebra::{Isometry3, Point3, SymmetricEigen, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::cloud::{Cloud, Thin};
use super::pairs::Fit;
use super::result::{FARTHEST, HOLD, OVERLAP, RESIDUAL, RegisterError, Registration};
use crate::scan::View;

/// A counterpart lies at most this far away. \[m\]
const COUNTERPART: f64 = 0.02;

/// One level: how far a counterpart may be \[m\], how the clouds are thinned, how many steps at most,
/// and how much a distance along the surface counts beside one across.
struct Level {
    reach: f64,
    thin: Thin,
    steps: usize,
    along: f64,
}

/// From coarse to fine; the first three from every start, the others from the best.
const LEVELS: [Level; 5] = [
    Level { reach: 0.20, thin: Thin::Voxel(0.030), steps: 25, along: 0.0 },
    Level { reach: 0.10, thin: Thin::Voxel(0.020), steps: 25, along: 0.0 },
    Level { reach: 0.05, thin: Thin::Voxel(0.012), steps: 25, along: 0.0 },
    Level { reach: 0.03, thin: Thin::Points(2_000), steps: 100, along: 1.0 },
    Level { reach: COUNTERPART, thin: Thin::Points(6_000), steps: 300, along: 1.0 },
];
/// Levels that are gone through from every start.
const COARSE: usize = 3;
/// Coarse results that are refined.
const CANDIDATES: usize = 4;
/// Most points of the other views on the levels that take points themselves.
const OTHERS: usize = 60_000;

/// Lays a view onto others.
///
/// # Errors
/// [`RegisterError`] with the figures of the best fit where that is not to be trusted.
pub fn register(others: &[View], view: &View) -> Result<Registration, RegisterError> {
    let cloud = |views: &[View], most: Option<usize>, level: &Level| match level.thin {
        Thin::Points(points) => Cloud::of(views, Thin::Points(most.unwrap_or(points))),
        voxel => Cloud::of(views, voxel),
    };
    let target: Vec<Cloud> = LEVELS.iter().map(|l| cloud(others, Some(OTHERS), l)).collect();
    let moving: Vec<Cloud> =
        LEVELS.iter().map(|l| cloud(std::slice::from_ref(view), None, l)).collect();
    let finest = LEVELS.len() - 1;
    let middle = middle(&moving[finest].points);
    let last = COARSE - 1;
    let mut coarse: Vec<(Isometry3<f64>, f64)> = starts(&middle)
        .into_par_iter()
        .map(|start| {
            let (target, moving) = (&target[..COARSE], &moving[..COARSE]);
            let pose = descend(target, moving, &LEVELS[..COARSE], start, &middle);
            (pose, Fit::new(&target[last], &moving[last], &pose, LEVELS[last].reach).score())
        })
        .collect();
    coarse.sort_by(|a, b| a.1.total_cmp(&b.1));
    coarse.dedup_by(|a, b| is_same(&a.0, &b.0, &middle));
    coarse.truncate(CANDIDATES);
    // What looks alike across the surface is told apart along it.
    let (target, moving) = (&target[COARSE..], &moving[COARSE..]);
    let fine: Vec<(Isometry3<f64>, f64)> = coarse
        .into_par_iter()
        .map(|(start, _)| {
            let pose = descend(target, moving, &LEVELS[COARSE..], start, &middle);
            let fit =
                Fit::new(&target[target.len() - 1], &moving[moving.len() - 1], &pose, COUNTERPART);
            (pose, fit.apart())
        })
        .collect();
    let best = fine.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let correction = best.map_or_else(Isometry3::identity, |best| best.0);
    let (target, moving) = (&target[target.len() - 1], &moving[moving.len() - 1]);
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

/// Goes down level by level from a start.
fn descend(
    target: &[Cloud],
    moving: &[Cloud],
    levels: &[Level],
    start: Isometry3<f64>,
    middle: &Point3<f64>,
) -> Isometry3<f64> {
    let mut pose = start;
    for ((target, moving), level) in target.iter().zip(moving).zip(levels) {
        for _ in 0..level.steps {
            let fit = Fit::new(target, moving, &pose, level.reach);
            if fit.pairs.len() < 20 {
                break;
            }
            let there = pose * middle;
            let (mut matrix, right, total) = fit.equations(&there, 1.0, level.along);
            // A trace of damping keeps what slides in place.
            for i in 0..6 {
                matrix[(i, i)] += 1e-6 * total.max(1.0);
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
    }
    pose
}

fn figures(
    target: &Cloud,
    moving: &Cloud,
    correction: &Isometry3<f64>,
    middle: &Point3<f64>,
) -> Registration {
    let fit = Fit::new(target, moving, correction, COUNTERPART);
    let before = Fit::new(target, moving, &Isometry3::identity(), COUNTERPART);
    let there = correction * middle;
    let apart = moving.points.iter().map(|p| (p - middle).norm_squared()).sum::<f64>();
    let size = (apart / moving.points.len().max(1) as f64).sqrt().max(1e-3);
    let (matrix, _, total) = fit.equations(&there, size, 0.0);
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
