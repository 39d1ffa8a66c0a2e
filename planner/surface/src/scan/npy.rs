//! NumPy arrays: a header in Python's words, then the numbers.

use nalgebra::Point3;

use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::warning::{Rest, ScanWarning};

const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads an array of points: shape (…, 3 or more) of numbers, or records with fields x, y, z.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let version = match bytes.strip_prefix(MAGIC) {
        Some([version, _, ..]) => *version,
        _ => return malformed(Place::Byte(0), "a NumPy array begins with \\x93NUMPY"),
    };
    let wide = if version == 1 { 2 } else { 4 };
    let length = bytes
        .get(8..8 + wide)
        .map(|b| b.iter().rev().fold(0usize, |length, byte| length << 8 | usize::from(*byte)));
    let begin = 8 + wide;
    let header = length.and_then(|length| bytes.get(begin..begin.checked_add(length)?));
    let (Some(header), Some(length)) = (header, length) else {
        return malformed(Place::Byte(8), "the header is cut short");
    };
    let header = String::from_utf8_lossy(header);
    let wrong = |cause: String| Malformed { place: Place::Byte(begin), cause };
    let array = Array::of(&header).map_err(wrong)?;
    array.points(&bytes[begin + length..], begin + length)
}

/// What the header says.
#[derive(Debug, PartialEq)]
struct Array {
    /// Bytes from one point to the next along the array.
    stride: usize,
    /// Where x, y, z are in a point.
    columns: [Column; 3],
    count: usize,
    /// Values beside x, y, z.
    others: bool,
    /// Points are records, whose fields' sizes add up to the stride.
    records: bool,
}

/// A number in a record.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column {
    at: usize,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Kind {
    letter: u8,
    size: usize,
    big: bool,
}

impl Kind {
    fn of(text: &str) -> Option<Self> {
        let big = text.starts_with('>');
        let text = text.trim_start_matches(['<', '>', '|', '=']);
        let letter = text.bytes().next()?;
        let size: usize = text.get(1..)?.parse().ok().filter(|size| (1..=1024).contains(size))?;
        // Text is counted in characters, of which each takes four bytes.
        let size = match letter {
            b'U' => 4 * size,
            b'f' | b'i' | b'u' | b'b' | b'c' | b'S' | b'V' => size,
            _ => return None,
        };
        Some(Self { letter, size, big })
    }

    fn is_number(self) -> bool {
        matches!((self.letter, self.size), (b'f', 4 | 8) | (b'i' | b'u', 1 | 2 | 4 | 8))
    }

    /// The number in bytes of its size.
    fn read(self, bytes: &[u8]) -> f64 {
        let mut wide = [0; 8];
        for (i, to) in wide[..self.size].iter_mut().enumerate() {
            *to = bytes[if self.big { self.size - 1 - i } else { i }];
        }
        let unsigned = u64::from_le_bytes(wide);
        let spare = 64 - 8 * self.size as u32;
        match (self.letter, self.size) {
            (b'f', 4) => f64::from(f32::from_bits(unsigned as u32)),
            (b'f', _) => f64::from_bits(unsigned),
            (b'i', _) => ((unsigned << spare) as i64 >> spare) as f64,
            _ => unsigned as f64,
        }
    }
}

impl Array {
    fn of(header: &str) -> Result<Self, String> {
        let shape: Vec<usize> = after(header, "shape")
            .and_then(|text| text.strip_prefix('(')?.split_once(')'))
            .and_then(|(inner, _)| {
                let words = inner.split(',').map(str::trim).filter(|word| !word.is_empty());
                words.map(|word| word.parse().ok()).collect()
            })
            .ok_or("the header has no shape")?;
        let fortran = after(header, "fortran_order").is_some_and(|text| text.starts_with("True"));
        if fortran && shape.len() > 1 {
            return Err(
                "the array lies column by column: save numpy.ascontiguousarray of it".into()
            );
        }
        let count =
            |dimensions: &[usize]| dimensions.iter().try_fold(1usize, |n, &d| n.checked_mul(d));
        let large = || format!("shape {shape:?} is too large");
        let descr = after(header, "descr").ok_or("the header has no descr")?;
        if let Some(fields) = descr.strip_prefix('[') {
            return Self::of_fields(fields, count(&shape).ok_or_else(large)?);
        }
        let name = quoted(descr).unwrap_or(descr);
        let kind = Kind::of(name).filter(|kind| kind.is_number());
        let kind = kind.ok_or_else(|| {
            format!("{name:.20} is no kind of number that is read: save the array as float64")
        })?;
        let [dimensions @ .., values] = &shape[..] else { return Err("a single number".into()) };
        if *values < 3 || dimensions.is_empty() {
            return Err(format!(
                "the array's shape is {shape:?}: points are wanted along the first axes and x, y, z \
                 along the last one"
            ));
        }
        let column = |i| Column { at: i * kind.size, kind };
        Ok(Self {
            stride: values.checked_mul(kind.size).ok_or_else(large)?,
            columns: [column(0), column(1), column(2)],
            count: count(dimensions).ok_or_else(large)?,
            others: *values > 3,
            records: false,
        })
    }

    /// Of fields "('x', '<f4'), …]".
    fn of_fields(text: &str, count: usize) -> Result<Self, String> {
        let (mut stride, mut columns, mut fields) = (0, [None; 3], 0);
        for field in text.split(']').next().unwrap_or("").split('(').skip(1) {
            let mut words = field.split(['\'', '"']).skip(1).step_by(2);
            let (name, kind) = (words.next().unwrap_or(""), words.next().and_then(Kind::of));
            let plain = field.matches(['\'', '"']).count() == 4;
            let Some(kind) = kind.filter(|_| plain) else {
                return Err(format!("field {name:?} is no single value of a kind that is read"));
            };
            for (column, wanted) in columns.iter_mut().zip(["x", "y", "z"]) {
                if name == wanted && kind.is_number() {
                    *column = Some(Column { at: stride, kind });
                }
            }
            stride += kind.size;
            fields += 1;
        }
        let [Some(x), Some(y), Some(z)] = columns else {
            return Err("its records have no fields x, y, z".into());
        };
        Ok(Self { stride, columns: [x, y, z], count, others: fields > 3, records: true })
    }

    fn points(&self, data: &[u8], begin: usize) -> Result<Parsed, Malformed> {
        let needed = self.stride.checked_mul(self.count).filter(|&needed| needed <= data.len());
        let Some(needed) = needed else {
            let found = data.len() / self.stride.max(1);
            return malformed(
                Place::Byte(begin + data.len()),
                format!("the data end after {found} of {} points", self.count),
            );
        };
        let mut parsed = Parsed::default();
        let point = |record: &[u8]| {
            Point3::from(self.columns.map(|column| column.kind.read(&record[column.at..])))
        };
        parsed.points = data[..needed].chunks_exact(self.stride).map(point).collect();
        if needed < data.len() {
            if self.records {
                let (more, stride, count) = (data.len() - needed, self.stride, self.count);
                return malformed(
                    Place::Byte(begin + needed),
                    format!("{more} bytes more than {count} records of {stride} bytes each"),
                );
            }
            let place = Place::Byte(begin + needed);
            parsed.warnings.push(ScanWarning::TrailingData { place });
        }
        // The fields of records have names.
        if self.others && !self.records {
            parsed.warnings.push(ScanWarning::Unnamed { first: 1, rest: Rest::Ignored });
        }
        Ok(parsed)
    }
}

/// What follows a key of the header.
fn after<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let at = header.find(&format!("'{key}'"))? + key.len() + 2;
    header[at..].trim_start().strip_prefix(':').map(str::trim_start)
}

/// The text in the first pair of quotes.
fn quoted(text: &str) -> Option<&str> {
    text.strip_prefix('\'')?.split('\'').next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn arrays_of_points_are_read_in_any_kind_of_number() {
        let floats: Vec<u8> =
            [1.5f32, -2.0, 3.0, 0.0, f32::NAN, 1.0].map(f32::to_le_bytes).concat();
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
        let parsed = parse(&file(header, &floats)).unwrap();
        assert_eq!(parsed.points[0], Point3::new(1.5, -2.0, 3.0));
        assert!(parsed.points[1].y.is_nan());
        assert_eq!(parsed.warnings, []);
        // An organised cloud of big-endian integers with a fourth value.
        let whole: Vec<u8> = (-4..4i16).flat_map(i16::to_be_bytes).collect();
        let header = "{'descr': '>i2', 'fortran_order': False, 'shape': (1, 2, 4), }";
        let parsed = parse(&file(header, &whole)).unwrap();
        assert_eq!(parsed.points, [Point3::new(-4.0, -3.0, -2.0), Point3::new(0.0, 1.0, 2.0)]);
        assert_eq!(parsed.warnings, [ScanWarning::Unnamed { first: 1, rest: Rest::Ignored }]);
        // Records.
        let header = "{'descr': [('i', '|u1'), ('z', '<f8'), ('y', '<f4'), ('x', '<u2')], \
                      'fortran_order': False, 'shape': (1,), }";
        let mut data = vec![7];
        data.extend(2.5f64.to_le_bytes());
        data.extend(1.25f32.to_le_bytes());
        data.extend(9u16.to_le_bytes());
        let parsed = parse(&file(header, &data)).unwrap();
        assert_eq!(parsed.points, [Point3::new(9.0, 1.25, 2.5)]);
        assert_eq!(parsed.warnings, []);
    }

    #[test]
    fn a_kind_of_number_that_is_not_read_is_named_alone() {
        for kind in ["<f2", "|O", "<c16"] {
            let header =
                format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (2, 3), }}");
            let cause = parse(&file(&header, &[0; 96])).unwrap_err().cause;
            let wanted = format!("{kind} is no kind of number that is read");
            assert!(cause.starts_with(&wanted), "{cause}");
        }
    }

    #[test]
    fn a_text_in_a_record_takes_four_bytes_a_character() {
        let header = "{'descr': [('label', '<U8'), ('x', '<f4'), ('y', '<f4'), ('z', '<f4')], \
                      'fortran_order': False, 'shape': (2,), }";
        let mut data = Vec::new();
        for k in [0.0f32, 1.0] {
            data.extend("a seat  ".chars().flat_map(|c| u32::from(c).to_le_bytes()));
            data.extend([1.0 + k, 2.0, 3.0].map(f32::to_le_bytes).concat());
        }
        let points = [Point3::new(1.0, 2.0, 3.0), Point3::new(2.0, 2.0, 3.0)];
        assert_eq!(parse(&file(header, &data)).unwrap().points, points);
    }

    #[test]
    fn what_is_no_array_of_points_is_refused_with_the_cause() {
        let of = |header: &str| parse(&file(header, &[0; 24])).unwrap_err().cause;
        let shape = |shape: &str| {
            of(&format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}"))
        };
        assert!(shape("3, 2").contains("[3, 2]"), "{}", shape("3, 2"));
        assert!(shape("").contains("single"));
        assert!(shape("9000000000000000000, 3").contains("2 of 9000000000000000000"));
        assert!(shape("9000000000000000000, 9000000000000000000, 3").contains("too large"));
        assert!(of("{'descr': '<c8', 'fortran_order': False, 'shape': (2, 3), }").contains("c8"));
        assert!(
            of("{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }").contains("column")
        );
        assert!(of("{'descr': [('a', '<f4')], 'shape': (2,), }").contains("x, y, z"));
        assert!(of("{'descr': [('x', '<f4', (3,))], 'shape': (2,), }").contains("single value"));
        assert!(of("{'descr': [('o', '|O8'), ('x', '<f4')], 'shape': (2,), }").contains("\"o\""));
        let records = "{'descr': [('x', '<f4'), ('y', '<f4'), ('z', '<f4')], 'shape': (1,), }";
        assert_eq!(of(records), "12 bytes more than 1 records of 12 bytes each");
        for cut in [0, 6, 9, 12] {
            let whole = file("{'descr': '<f4', 'shape': (2, 3), }", &[0; 24]);
            assert!(parse(&whole[..cut]).is_err(), "{cut}");
        }
    }
}
