//! Two views of one thing, the halves of a file, laid onto each other.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_surface::register::register;
use nullsweep_surface::scan::View;

use crate::room::table;
use crate::scan::scans;

/// Points of two views that are laid onto each other here.
const POINTS: usize = 4000;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let views = scans(bytes).into_iter().filter(|raw| raw.points.len() <= POINTS);
    views.filter(|raw| lay(&raw.points)).count() > 0
}

/// Whether the second half lies on the first.
fn lay(points: &[Point3<f64>]) -> bool {
    let (first, second) = points.split_at(points.len() / 2);
    let [first, second] = [first, second].map(|p| View { points: p.to_vec(), ..View::default() });
    let Ok(found) = register(&[first], &second) else { return false };
    let figures = [found.moved, found.turned, found.overlap, found.residual, found.hold];
    assert!(figures.iter().all(|x| x.is_finite() && *x >= 0.0), "{found:?}");
    assert!((found.correction.rotation.quaternion().norm() - 1.0).abs() < 1e-9, "{found:?}");
    true
}

pub(crate) fn made() -> Vec<Vec<u8>> {
    // Three faces of a box, seen twice, the second time from a camera that is a little off.
    let count = 22u32;
    let grid = move |side: f64| {
        (0..count * count).map(move |k| [side * f64::from(k % count), side * f64::from(k / count)])
    };
    let faces = move |side: f64| {
        grid(side)
            .flat_map(|[u, v]| [[u, v, 0.0], [u, 0.0, v], [0.0, u, v]])
            .map(|[x, y, z]| Point3::new(x, 0.8 * y, 0.6 * z))
    };
    let off = Isometry3::new(Vector3::new(0.01, -0.006, 0.004), Vector3::new(0.02, 0.01, -0.02));
    vec![table(faces(0.013).chain(faces(0.0127).map(move |p| off * p)))]
}
