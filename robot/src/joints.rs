//! Angles of joints.

use std::f64::consts::{PI, TAU};

/// The same angle in (−π, π]. \[rad\]
#[must_use]
#[inline]
pub fn wrap(angle: f64) -> f64 {
    let wrapped = angle - (angle / TAU).round() * TAU;
    // Half a turn rounds either way.
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}
