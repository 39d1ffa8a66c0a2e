//! Joint vectors that fill ranges evenly, without a random generator.

use std::f64::consts::PI;

use crate::{JointVector, MAX_DOF};

/// The k-th joint vector of a sequence that fills the ranges evenly; joints without an end take
/// −π … π.
pub(crate) fn spread_over(ranges: &[(f64, f64)], k: usize) -> JointVector {
    let mut q = [0.0; MAX_DOF];
    for (i, &(lower, upper)) in ranges.iter().enumerate() {
        let (lower, upper) = if lower.is_finite() { (lower, upper) } else { (-PI, PI) };
        q[i] = lower + (upper - lower) * spread(k, i);
    }
    JointVector::new(q)
}

/// The k-th number of the van der Corput sequence to the base of a joint (Halton's sequence over
/// all joints), in (0, 1): even coverage without a random generator.
pub(super) fn spread(k: usize, joint: usize) -> f64 {
    const PRIMES: [usize; MAX_DOF] = [2, 3, 5, 7, 11, 13, 17, 19];
    // The first numbers of the larger bases rise together, so the sequence begins later.
    let (mut k, base) = (k + 20, PRIMES[joint]);
    let (mut value, mut weight) = (0.0, 1.0 / base as f64);
    while k > 0 {
        value += (k % base) as f64 * weight;
        k /= base;
        weight /= base as f64;
    }
    value
}
