//! Sine, cosine and arc tangent of four numbers at once, of additions, multiplications and divisions
//! that are rounded each by itself: every processor finds the same bits.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, PI};

use wide::f64x4;

/// Added and taken away again it leaves the nearest whole number.
const WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;
/// π/2 in three parts, the first two of 33 bits: whole multiples up to [`FAR`] are exact.
const QUARTER: [f64; 3] =
    [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// Angles beyond are left to `libm`. \[rad\]
const FAR: f64 = 1e5;
/// tan π/8.
const EIGHTH: f64 = 0.414_213_562_373_095_03;
/// arctan √u / √u for u up to tan² π/8, within 2·10⁻¹⁸: Chebyshev's interpolation, from the constant on.
const ARC_TANGENT: [f64; 12] = [
    1.0,
    -0.333_333_333_333_331_2,
    0.199_999_999_999_408_37,
    -0.142_857_142_792_449_68,
    0.111_111_107_446_570_99,
    -0.090_908_968_014_728_13,
    0.076_920_451_945_614_81,
    -0.066_629_502_460_367_92,
    0.058_468_667_522_751_39,
    -0.050_350_497_953_124_39,
    0.037_963_903_161_110_83,
    -0.017_803_896_394_812_564,
];
/// Coefficients of sin x / x and cos x in x²: Taylor's, which up to π/4 suffice for the last bit.
const SINE: [f64; 9] = series(1);
/// See [`SINE`].
const COSINE: [f64; 9] = series(0);

/// (−1)ᵏ / (2k + first)!
const fn series(first: usize) -> [f64; 9] {
    let mut terms = [1.0; 9];
    let mut k = 1;
    while k < terms.len() {
        let n = 2 * k + first;
        terms[k] = -terms[k - 1] / ((n - 1) * n) as f64;
        k += 1;
    }
    terms
}

/// Horner's scheme.
#[inline]
fn polynomial(coefficients: &[f64], x: f64x4) -> f64x4 {
    coefficients.iter().rev().fold(f64x4::ZERO, |sum, &c| sum * x + f64x4::splat(c))
}

#[inline]
fn nearest_whole(x: f64x4) -> f64x4 {
    (x + f64x4::splat(WHOLE)) - f64x4::splat(WHOLE)
}

/// Sines and cosines. \[rad\]
#[inline]
pub(crate) fn sin_cos(angle: f64x4) -> (f64x4, f64x4) {
    if !angle.abs().simd_lt(f64x4::splat(FAR)).all() {
        let both = angle.to_array().map(libm::sincos);
        return (f64x4::new(both.map(|b| b.0)), f64x4::new(both.map(|b| b.1)));
    }
    let quarters = nearest_whole(angle * f64x4::splat(FRAC_2_PI));
    let rest = QUARTER.iter().fold(angle, |rest, &part| rest - quarters * f64x4::splat(part));
    let square = rest * rest;
    let (sine, cosine) = (rest * polynomial(&SINE, square), polynomial(&COSINE, square));
    // −2 … 2; two quarters turn both signs, one exchanges the two.
    let quarter = quarters - f64x4::splat(4.0) * nearest_whole(quarters * f64x4::splat(0.25));
    let sign = f64x4::ONE - quarter.abs();
    let odd = quarter.abs().simd_eq(f64x4::ONE);
    (odd.select(quarter * cosine, sign * sine), odd.select(-quarter * sine, sign * cosine))
}

/// Angles of the points (x, y), in [−π, π]; 0 for the origin. \[rad\]
#[inline]
pub(crate) fn atan2(y: f64x4, x: f64x4) -> f64x4 {
    let (along, beside) = (x.abs(), y.abs());
    let steep = beside.simd_gt(along);
    let low = steep.select(along, beside);
    let high = steep.select(beside, along);
    // arctan t = π/4 + arctan (t − 1)/(t + 1).
    let wide = low.simd_gt(high * f64x4::splat(EIGHTH));
    let over = wide.select(low - high, low);
    let under = wide.select(low + high, high);
    let none = under.simd_eq(f64x4::ZERO);
    let tangent = over / none.select(f64x4::ONE, under);
    let arc = tangent * polynomial(&ARC_TANGENT, tangent * tangent);
    let arc = wide.select(f64x4::splat(FRAC_PI_4) + arc, arc);
    let arc = steep.select(f64x4::splat(FRAC_PI_2) - arc, arc);
    let arc = x.simd_lt(f64x4::ZERO).select(f64x4::splat(PI) - arc, arc);
    y.simd_lt(f64x4::ZERO).select(-arc, arc)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles() -> impl Iterator<Item = f64> {
        let near = (-40_000..40_000).map(|k| f64::from(k) * 0.000_37);
        let far = (0..2000).map(|k| f64::from(k) * 61.7 - 60_000.0);
        let corners = (-16..=16).map(|k| f64::from(k) * FRAC_PI_4);
        near.chain(far).chain(corners).chain([0.0, -0.0, 1e-300, 1e5, -3e9, 1e300])
    }

    #[test]
    fn they_are_what_one_number_has() {
        for x in angles() {
            let (s, c) = sin_cos(f64x4::splat(x));
            let (sine, cosine) = libm::sincos(x);
            assert!((s.to_array()[0] - sine).abs() <= 2.3e-16, "sin {x}");
            assert!((c.to_array()[3] - cosine).abs() <= 2.3e-16, "cos {x}");
            for length in [1e-200, 1.0, 1e200] {
                let found = atan2(f64x4::splat(length * sine), f64x4::splat(length * cosine));
                let wanted = libm::atan2(length * sine, length * cosine);
                assert!((found.to_array()[1] - wanted).abs() <= 9e-16, "atan2 at {x}");
            }
        }
        let axes = [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, FRAC_PI_2), (0.0, -1.0, PI)];
        for (y, x, wanted) in axes {
            assert_eq!(atan2(f64x4::splat(y), f64x4::splat(x)).to_array()[2], wanted);
        }
    }

    #[test]
    fn lanes_do_not_see_each_other() {
        let four = [0.1, 2.0, -3.0, 7e6];
        let (s, c) = sin_cos(f64x4::new(four));
        for (k, &x) in four.iter().enumerate() {
            assert!((s.to_array()[k] - libm::sin(x)).abs() <= 2.3e-16);
            assert!((c.to_array()[k] - libm::cos(x)).abs() <= 2.3e-16);
        }
    }

    /// Fails on a processor, or with a `libm`, that rounds otherwise: plans would be others there.
    #[test]
    fn bits_are_the_same_everywhere() {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |value: f64| hash = (hash ^ value.to_bits()).wrapping_mul(0x0100_0000_01b3);
        for x in angles() {
            let (s, c) = sin_cos(f64x4::splat(x));
            add(s.to_array()[0]);
            add(c.to_array()[0]);
            add(atan2(s, c).to_array()[0]);
            let unit = libm::sin(x);
            let two = [libm::atan2(unit, x), libm::hypot(unit, x), libm::pow(x.abs(), unit)];
            let one = [libm::cos(x), libm::tan(x), libm::acos(unit), libm::log(x.abs())];
            two.into_iter().chain(one).for_each(&mut add);
        }
        assert_eq!(hash, 0x057a_bbc0_abac_f32b, "{hash:#x}");
    }
}
