//! How far the measured positions were from the commanded ones.

use serde::{Deserialize, Serialize};

/// The largest error of any joint at each measurement while a plan ran. \[rad\] or \[m\]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tracking {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Tracking {
    /// Of these errors; `None` without any.
    #[must_use]
    pub fn of(mut errors: Vec<f64>) -> Option<Self> {
        errors.sort_by(f64::total_cmp);
        let last = errors.len().checked_sub(1)?;
        let at = |share: f64| errors[(share * last as f64).round() as usize];
        Some(Self { p50: at(0.5), p95: at(0.95), max: at(1.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_the_sorted_errors() {
        assert_eq!(Tracking::of(Vec::new()), None);
        let errors = (0..=100).rev().map(f64::from).collect();
        assert_eq!(Tracking::of(errors), Some(Tracking { p50: 50.0, p95: 95.0, max: 100.0 }));
    }
}
