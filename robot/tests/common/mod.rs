//! What the tests of this crate share.

use std::path::PathBuf;

use nullsweep_robot::{Arm, JointVector};
use rand::{Rng, RngExt};

/// A file of the shared test data, or `None`, saying so, where that is absent.
pub(crate) fn data(path: &str) -> Option<PathBuf> {
    let file = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(path);
    if file.exists() {
        return Some(file);
    }
    println!("skipped: {} is not there", file.display());
    None
}

/// Uniform in the margined limits, continuous joints in ±π.
pub(crate) fn random(arm: &Arm, rng: &mut impl Rng) -> JointVector {
    let mut q = JointVector::ZERO;
    for (q, &(lower, upper)) in q.iter_mut().zip(arm.margined_limits()) {
        *q = if lower.is_finite() {
            rng.random_range(lower..upper)
        } else {
            rng.random_range(-std::f64::consts::PI..std::f64::consts::PI)
        };
    }
    q
}

/// Largest difference of two configurations, by whole turns. \[rad\]
pub(crate) fn farthest<'a>(
    a: impl IntoIterator<Item = &'a f64>,
    b: impl IntoIterator<Item = &'a f64>,
) -> f64 {
    let apart = |(a, b): (&f64, &f64)| {
        let d = (a - b).rem_euclid(std::f64::consts::TAU);
        d.min(std::f64::consts::TAU - d)
    };
    a.into_iter().zip(b).map(apart).fold(0.0, f64::max)
}
