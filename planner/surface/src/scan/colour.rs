//! Colours as files have them.

/// Red, green and blue of a value that packs them into 24 bits: the number itself, or, as the Point Cloud
/// Library writes it, the bits of a single-precision number.
pub(super) fn unpacked(value: f64) -> [u8; 3] {
    let whole = value.fract() == 0.0 && value.abs() <= f64::from(u32::MAX);
    let bits = if whole { value as i64 as u32 } else { (value as f32).to_bits() };
    [16, 8, 0].map(|shift| (bits >> shift) as u8)
}

/// Red, green and blue of three values each: 0 to 1 where none is greater, else 0 to 255. None where a
/// value is no such number.
pub(super) fn of_columns(values: &[[f64; 3]]) -> Vec<[u8; 3]> {
    let most = values.iter().flatten().copied().fold(0.0, f64::max);
    let is_colour = values.iter().flatten().all(|v| (0.0..=255.0).contains(v));
    if !is_colour {
        return Vec::new();
    }
    let factor = if most <= 1.0 { 255.0 } else { 1.0 };
    values.iter().map(|rgb| rgb.map(|v| (v * factor).round() as u8)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_colour_is_taken_apart_however_it_is_written() {
        let packed = 0x00c8_1e28_u32;
        assert_eq!(unpacked(f64::from(packed)), [200, 30, 40]);
        assert_eq!(unpacked(f64::from(f32::from_bits(packed))), [200, 30, 40]);
        assert_eq!(unpacked(f64::from(0xffc8_1e28_u32)), [200, 30, 40]);
        assert_eq!(of_columns(&[[1.0, 0.5, 0.0]]), [[255, 128, 0]]);
        assert_eq!(of_columns(&[[1.0, 0.0, 0.0], [200.0, 30.0, 40.0]])[1], [200, 30, 40]);
        assert!(of_columns(&[[300.0, 0.0, 0.0]]).is_empty());
        assert!(of_columns(&[[f64::NAN, 0.0, 0.0]]).is_empty());
    }
}
