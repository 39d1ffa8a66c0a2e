//! Bytes that are to be text.

use std::borrow::Cow;

use super::error::{Malformed, Place, malformed};
use super::warning::ScanWarning;

/// Bytes without a leading UTF-8 byte-order mark.
pub(super) fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// The content as text without a byte-order mark: UTF-8, UTF-16 by its mark, else Latin-1, which is
/// told. Bytes that no text has, zeros, are refused.
pub(super) fn decode<'a>(
    bytes: &'a [u8],
    warnings: &mut Vec<ScanWarning>,
) -> Result<Cow<'a, str>, Malformed> {
    let wide = |from: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|pair| from([pair[0], pair[1]]));
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes {
        [0xFF, 0xFE, ..] => return Ok(Cow::Owned(wide(u16::from_le_bytes))),
        [0xFE, 0xFF, ..] => return Ok(Cow::Owned(wide(u16::from_be_bytes))),
        _ => {}
    }
    if let Some(at) = bytes.iter().position(|&b| b == 0) {
        return malformed(Place::Byte(at), "0x00 is not text: is the file a binary one?");
    }
    let content = without_bom(bytes);
    let text = match std::str::from_utf8(content) {
        Ok(text) => Cow::Borrowed(text),
        Err(e) => {
            let at = bytes.len() - content.len() + e.valid_up_to();
            warnings.push(ScanWarning::NotUtf8 { place: Place::Byte(at) });
            Cow::Owned(content.iter().map(|&b| char::from(b)).collect())
        }
    };
    // Lines may end as they did on the first Macintosh.
    let old = text.contains('\r') && !text.contains('\n');
    Ok(if old { Cow::Owned(text.replace('\r', "\n")) } else { text })
}

/// What stands for a number that is not there.
const MISSING: [&str; 12] = [
    "",
    "na",
    "n/a",
    "null",
    "none",
    "-",
    "nil",
    "1.#qnan",
    "-1.#ind",
    "1.#ind",
    "-nan(ind)",
    "nan(ind)",
];

/// A number as programs write it; NaN where it says that there is none. `None`: no number.
pub(super) fn number(token: &str) -> Option<f64> {
    if let Ok(value) = token.parse() {
        return Some(value);
    }
    if MISSING.iter().any(|text| token.eq_ignore_ascii_case(text)) {
        return Some(f64::NAN);
    }
    // Fortran's exponents.
    let plain = token.bytes().all(|b| b.is_ascii_digit() || b"+-.dD".contains(&b));
    plain.then(|| token.replace(['d', 'D'], "e").parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_every_encoding_is_read_and_what_is_guessed_is_told() {
        let mut warnings = Vec::new();
        let wide: Vec<u8> = [0xFEFF]
            .into_iter()
            .chain("a ü\n".encode_utf16())
            .collect::<Vec<_>>()
            .iter()
            .flat_map(|unit| unit.to_le_bytes())
            .collect();
        assert_eq!(decode(&wide, &mut warnings).unwrap(), "a ü\n");
        assert_eq!(decode("\u{feff}ü".as_bytes(), &mut warnings).unwrap(), "ü");
        assert_eq!(warnings, []);
        assert_eq!(decode(b"a f\xFCr", &mut warnings).unwrap(), "a für");
        assert_eq!(warnings, [ScanWarning::NotUtf8 { place: Place::Byte(3) }]);
        assert!(decode(b"1 2\0 3", &mut warnings).is_err());
    }

    #[test]
    fn numbers_are_read_as_programs_write_them() {
        assert_eq!(number("+1.5"), Some(1.5));
        assert_eq!(number("-2.5D-01"), Some(-0.25));
        for nothing in ["", "NaN", "NA", "null", "-nan(ind)"] {
            assert!(number(nothing).is_some_and(f64::is_nan), "{nothing}");
        }
        for wrong in ["x", "1,5", "0x10", "d"] {
            assert_eq!(number(wrong), None, "{wrong}");
        }
    }
}
