//! Laying one view onto others: registration by iterative closest points, from coarse to fine.
//!
//! It starts from where the view is said to stand, and from a few places around that, and goes point
//! to plane (Chen & Medioni 1992) with the planes of both sides (Rusinkiewicz 2019), which slides to
//! its place in a few steps. The last levels go point to point (Besl & McKay 1992): where a shape is
//! nearly flat, its ends say more than the sensor's distortion across it. The result comes with how
//! much of the view has a counterpart and how far that is away; a result that these do not bear out
//! is refused.

use nalgebra::{
    Isometry3, Matrix6, Point3, SymmetricEigen, Translation3, UnitQuaternion, UnitVector3, Vector3,
    Vector6,
};
use rayon::prelude::*;
use thiserror::Error;

use crate::fit::{PlaneFit, weight};
use crate::grid::Grid;
use crate::scan::View;

/// Where a view was laid, and how well it lies there.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// Moves the view's points onto the others. \[m\]
    pub correction: Isometry3<f64>,
    /// How far the view's middle is moved. \[m\]
    pub moved: f64,
    /// How far the view is turned. \[rad\]
    pub turned: f64,
    /// The share of the view that has a counterpart in the others.
    pub overlap: f64,
    /// The same where the view was said to stand.
    pub overlap_before: f64,
    /// Root mean square distance of that part from its counterpart, across the surface. \[m\]
    pub residual: f64,
    /// The same where the view was said to stand. \[m\]
    pub residual_before: f64,
    /// How firmly the shape holds the view in the direction in which it may slide most easily: the
    /// share of the surface that looks that way.
    pub hold: f64,
}

impl Registration {
    /// Whether the view lies clearly better than where it was said to stand.
    #[must_use]
    pub fn is_needed(&self) -> bool {
        self.residual_before > 1.3 * self.residual || self.overlap_before < 0.95 * self.overlap
    }
}

/// Why a registration is not trusted.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum RegisterError {
    /// The views share too little.
    #[error(
        "only {:.0} % of the view have a counterpart in the others (needed are {:.0} %; residual \
         {:.1} mm)",
        .found.overlap * 100.0, OVERLAP * 100.0, .found.residual * 1e3
    )]
    Overlap {
        /// The best that was found.
        found: Registration,
    },
    /// What they share does not fit.
    #[error(
        "the views do not fit: {:.1} mm apart where they overlap ({:.0} %), at most {:.1} mm is taken \
         for the sensor's noise",
        .found.residual * 1e3, .found.overlap * 100.0, RESIDUAL * 1e3
    )]
    Residual {
        /// The best that was found.
        found: Registration,
    },
    /// What they share may slide, as planes and cylinders do.
    #[error(
        "the shape does not hold the view in place: it may slide, as flat and round things do \
         (overlap {:.0} %, residual {:.1} mm)",
        .found.overlap * 100.0, .found.residual * 1e3
    )]
    Slides {
        /// The best that was found.
        found: Registration,
    },
    /// The best fit is too far from where the view was said to be.
    #[error(
        "the views fit only {:.0} mm and {:.1}° from where they were said to be (overlap {:.0} %, \
         residual {:.1} mm)",
        .found.moved * 1e3, .found.turned.to_degrees(), .found.overlap * 100.0,
        .found.residual * 1e3
    )]
    TooFar {
        /// The best that was found.
        found: Registration,
    },
}

/// Least overlap.
const OVERLAP: f64 = 0.35;
/// Greatest residual. \[m\]
const RESIDUAL: f64 = 0.006;
/// Least hold.
const HOLD: f64 = 0.003;
/// Farthest that a view is moved \[m\] and turned \[rad\].
const FARTHEST: (f64, f64) = (0.30, 0.26);
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

/// How a cloud is thinned.
#[derive(Clone, Copy)]
enum Thin {
    /// To the means of voxels. \[m\]
    Voxel(f64),
    /// To points of the view itself, at most so many in what moves: the same wherever it stands.
    Points(usize),
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
/// Most points of the other views on the levels that take points themselves.
const OTHERS: usize = 60_000;
/// The cosine of the greatest angle between the normals of counterparts.
const ALIKE: f64 = 0.7;
/// Radius of the neighbourhood of which a normal is made, at least. \[m\]
const RADIUS: f64 = 0.024;

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
    let coarse: Vec<(Isometry3<f64>, f64)> = starts(&middle)
        .into_par_iter()
        .map(|start| {
            let (target, moving) = (&target[..COARSE], &moving[..COARSE]);
            let pose = descend(target, moving, &LEVELS[..COARSE], start, &middle);
            (pose, Fit::new(&target[last], &moving[last], &pose, LEVELS[last].reach).score())
        })
        .collect();
    let best = coarse.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let start = best.map_or_else(Isometry3::identity, |best| best.0);
    let fine = (&target[COARSE..], &moving[COARSE..]);
    let correction = descend(fine.0, fine.1, &LEVELS[COARSE..], start, &middle);
    let found = figures(&target[finest], &moving[finest], &correction, &middle);
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

/// A thinned cloud with normals, towards the sensor where that is known.
struct Cloud {
    points: Vec<Point3<f64>>,
    normals: Vec<UnitVector3<f64>>,
    /// Whether all normals have a side.
    sided: bool,
    grid: Grid,
}

impl Cloud {
    fn of(views: &[View], thin: Thin) -> Self {
        let all: usize = views.iter().map(|view| view.points.len()).sum();
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for view in views {
            let (kept, around, radius) = match thin {
                Thin::Voxel(side) => {
                    let thin = thinned(&view.points, side);
                    (thin.clone(), thin, (2.5 * side).max(RADIUS))
                }
                Thin::Points(most) => {
                    let stride = all.div_ceil(most.max(1)).max(1);
                    let kept = view.points.iter().step_by(stride).copied().collect();
                    (kept, view.points.clone(), RADIUS)
                }
            };
            let grid = Grid::new(&around, radius);
            let found: Vec<Option<UnitVector3<f64>>> =
                kept.par_iter().map(|p| normal(p, &grid, radius, view.sensor)).collect();
            for (point, normal) in kept.iter().zip(found).filter_map(|(p, n)| Some((p, n?))) {
                points.push(*point);
                normals.push(normal);
            }
        }
        let side = match thin {
            Thin::Voxel(side) => 2.0 * side,
            Thin::Points(_) => 0.5 * RADIUS,
        };
        let sided = views.iter().all(|view| view.sensor.is_some());
        Self { grid: Grid::new(&points, side), points, normals, sided }
    }
}

fn thinned(points: &[Point3<f64>], voxel: f64) -> Vec<Point3<f64>> {
    let mut cells = std::collections::BTreeMap::new();
    for point in points {
        let key = [0, 1, 2].map(|axis| (point[axis] / voxel).floor() as i64);
        let cell: &mut (Vector3<f64>, f64) = cells.entry(key).or_insert((Vector3::zeros(), 0.0));
        cell.0 += point.coords;
        cell.1 += 1.0;
    }
    cells.into_values().map(|(sum, count)| Point3::from(sum / count)).collect()
}

/// The normal at a point; none where its neighbours are no surface.
fn normal(
    point: &Point3<f64>,
    grid: &Grid,
    radius: f64,
    sensor: Option<Point3<f64>>,
) -> Option<UnitVector3<f64>> {
    let mut fit = PlaneFit::new(*point);
    let mut count = 0;
    grid.within(point, radius, |_, neighbour, squared| {
        count += 1;
        fit.add(neighbour, weight(squared / (radius * radius)));
    });
    let plane = fit.solve().filter(|_| count >= 6)?;
    let [across, shorter, longer] = plane.variances;
    if across > 0.2 * shorter || shorter < 0.05 * longer {
        return None;
    }
    Some(match sensor {
        Some(sensor) if (sensor - point).dot(&plane.normal) < 0.0 => -plane.normal,
        _ => plane.normal,
    })
}

fn middle(points: &[Point3<f64>]) -> Point3<f64> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    Point3::from(sum / points.len().max(1) as f64)
}

/// A point of the view where it lies, its counterpart, and the normal of both.
struct Pair {
    point: Point3<f64>,
    to: Point3<f64>,
    normal: Vector3<f64>,
}

impl Pair {
    fn distance(&self) -> f64 {
        (self.point - self.to).dot(&self.normal)
    }
}

/// The counterparts of a view at a pose.
struct Fit {
    pairs: Vec<Pair>,
    /// Points of the view.
    of: usize,
    reach: f64,
}

impl Fit {
    fn new(target: &Cloud, moving: &Cloud, pose: &Isometry3<f64>, reach: f64) -> Self {
        let sided = target.sided && moving.sided;
        let pair = |i: usize| {
            let point = pose * moving.points[i];
            let normal = pose.rotation * moving.normals[i];
            let alike = |j: u32| {
                let dot = normal.dot(&target.normals[j as usize]);
                if sided { dot > ALIKE } else { dot.abs() > ALIKE }
            };
            let (j, _) = target.grid.nearest(&point, reach, alike)?;
            let j = j as usize;
            let other = target.normals[j];
            let other = if normal.dot(&other) < 0.0 { -other } else { other };
            let both = (normal.into_inner() + other.into_inner()).normalize();
            Some(Pair { point, to: target.points[j], normal: both })
        };
        let pairs = (0..moving.points.len()).filter_map(pair).collect();
        Self { pairs, of: moving.points.len(), reach }
    }

    /// Mean robust distance, what has no counterpart as far as the reach. \[m²\]
    fn score(&self) -> f64 {
        let limit = self.reach * self.reach;
        let near: f64 = self.pairs.iter().map(|pair| pair.distance().powi(2).min(limit)).sum();
        (near + (self.of - self.pairs.len()) as f64 * limit) / self.of.max(1) as f64
    }

    /// Root mean square distance across the surface. \[m\]
    fn residual(&self) -> f64 {
        let squares: f64 = self.pairs.iter().map(|pair| pair.distance().powi(2)).sum();
        (squares / self.pairs.len().max(1) as f64).sqrt()
    }

    /// The matrix and right side of the step about a middle, turns in units of `size`, and the sum of
    /// the weights; distances along the surface count `along` times.
    fn equations(
        &self,
        middle: &Point3<f64>,
        size: f64,
        along: f64,
    ) -> (Matrix6<f64>, Vector6<f64>, f64) {
        let counted = |pair: &Pair| {
            let (apart, across) = ((pair.point - pair.to).norm_squared(), pair.distance().powi(2));
            across + along * (apart - across).max(0.0)
        };
        let mut distances: Vec<f64> = self.pairs.iter().map(|pair| counted(pair).sqrt()).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let median = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
        // Tukey's biweight: across a surface with its usual tuning on the robust deviation, which
        // along it would take the ends for outliers.
        let limit = (1.4826 * median * if along > 0.0 { 20.0 } else { 4.685 }).max(1e-4);
        let (mut matrix, mut right, mut total) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        for pair in &self.pairs {
            let w = weight(counted(pair) / (limit * limit));
            let apart = pair.point - pair.to;
            let arm = pair.point - middle;
            let mut add = |axis: &Vector3<f64>, w: f64| {
                let turn = arm.cross(axis) / size;
                let row = Vector6::new(turn.x, turn.y, turn.z, axis.x, axis.y, axis.z);
                matrix += row * row.transpose() * w;
                right -= row * (w * apart.dot(axis));
            };
            add(&pair.normal, w * (1.0 - along));
            if along > 0.0 {
                (0..3).for_each(|i| add(&Vector3::ith(i, 1.0), w * along));
            }
            total += w;
        }
        (matrix, right, total)
    }
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
            normals: None,
            sensor: view.sensor.map(|s| pose * s),
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
            normals: None,
            sensor: Some(Point3::new(0.2, 0.2, 2.0)),
        };
        let error = register(std::slice::from_ref(&plate), &plate).unwrap_err();
        assert!(matches!(error, RegisterError::Slides { .. }), "{error}");
    }

    #[test]
    fn no_cloud_at_all_is_refused() {
        let empty = View { points: Vec::new(), normals: None, sensor: None };
        assert!(register(&[], &empty).is_err());
    }
}
