//! What a registration came to.

use nalgebra::Isometry3;
use thiserror::Error;

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
pub(super) const OVERLAP: f64 = 0.35;
/// Greatest residual. \[m\]
pub(super) const RESIDUAL: f64 = 0.006;
/// Least hold.
pub(super) const HOLD: f64 = 0.003;
/// Farthest that a view is moved \[m\] and turned \[rad\].
pub(super) const FARTHEST: (f64, f64) = (0.30, 0.26);
