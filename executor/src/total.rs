//! Arithmetic that the loop may do with any numbers: nothing here panics, and what is not a number
//! stays one or falls on the safe side. `f64::clamp` panics where its bounds are not in order,
//! `f64::max` and `f64::min` swallow a NaN.

/// `x`, at least `low` and at most `high`; `low` where `x` is NaN or the bounds are not in order.
#[must_use]
pub(crate) fn within(x: f64, low: f64, high: f64) -> f64 {
    if !(low <= high) || !(x >= low) {
        low
    } else if x <= high {
        x
    } else {
        high
    }
}

/// A change of at most `most` either way; none where one of the two is NaN or `most` is negative.
#[must_use]
pub(crate) fn limited(change: f64, most: f64) -> f64 {
    if !(most >= 0.0) || change.is_nan() { 0.0 } else { within(change, -most, most) }
}

/// The greater one; NaN where one of them is.
#[must_use]
pub(crate) fn greater(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ODD: [f64; 9] =
        [f64::NAN, f64::NEG_INFINITY, f64::MIN, -1.0, 0.0, 1e-300, 1.0, f64::MAX, f64::INFINITY];

    #[test]
    fn every_number_has_an_answer_on_the_safe_side() {
        for a in ODD {
            for b in ODD {
                let most = limited(a, b);
                assert!(most == 0.0 || most.abs() <= b, "a step of {most} for {a} by {b}");
                assert_eq!(greater(a, b).is_nan(), a.is_nan() || b.is_nan());
                assert!(greater(a, b).is_nan() || (greater(a, b) >= a && greater(a, b) >= b));
                for x in ODD {
                    let held = within(x, a, b);
                    if a <= b {
                        assert!(held >= a && held <= b, "{held} for {x} in {a} … {b}");
                        assert!(!(x >= a && x <= b) || held == x);
                    } else {
                        assert!(held == a || a.is_nan());
                    }
                }
            }
        }
    }
}
