//! PCD, the Point Cloud Library's format: ascii, binary and binary_compressed.
//!
//! An own reader, because `pcd-rs` panics on a compressed body that is shorter than its header
//! says and names no line or byte for most errors; the tests hold the two against each other.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::colour::unpacked;
use super::decode::{number, without_bom};
use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// Longest header that is looked for. \[byte\]
const MAX_HEADER: usize = 1 << 16;

/// LZF packs at most 264 bytes into 3, so a larger announced size is a lie that would only
/// allocate memory.
const MAX_LZF_RATIO: usize = 88;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let skipped = bytes.len() - without_bom(bytes).len();
    let mut parsed = Parsed::default();
    let header = Header::parse(bytes, skipped, &mut parsed.warnings)?;
    parsed.viewpoint = header.viewpoint;
    match header.encoding {
        Encoding::Ascii => ascii(bytes, &header, &mut parsed)?,
        Encoding::Binary => binary(bytes, &header, &mut parsed)?,
        Encoding::Compressed => compressed(bytes, &header, &mut parsed)?,
    }
    Ok(parsed)
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

#[derive(Clone, Copy)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

struct Field {
    name: String,
    kind: Kind,
    /// Bytes of one value.
    size: usize,
    /// Values in the field.
    count: usize,
}

impl Field {
    /// One value from its little-endian bytes.
    fn value(&self, bytes: &[u8]) -> f64 {
        let mut wide = [0; 8];
        wide[..self.size].copy_from_slice(&bytes[..self.size]);
        let raw = u64::from_le_bytes(wide);
        match (self.kind, self.size) {
            (Kind::Float, 4) => f64::from(f32::from_bits(raw as u32)),
            (Kind::Float, _) => f64::from_bits(raw),
            (Kind::Unsigned, _) => raw as f64,
            (Kind::Signed, size) => {
                let unused = 64 - 8 * size as u32;
                (((raw << unused) as i64) >> unused) as f64
            }
        }
    }
}

struct Header {
    fields: Vec<Field>,
    points: usize,
    encoding: Encoding,
    viewpoint: Option<Isometry3<f64>>,
    /// Fields of x, y, z.
    position: [usize; 3],
    /// Fields of the normal.
    normal: Option<[usize; 3]>,
    /// Field of the packed colour: its bits, not the number that they are.
    colour: Option<usize>,
    /// Bytes of one point.
    record: usize,
    /// Where the body begins. \[byte\]
    body: usize,
    /// Lines of the header.
    lines: usize,
}

impl Header {
    fn parse(
        bytes: &[u8],
        skipped: usize,
        warnings: &mut Vec<ScanWarning>,
    ) -> Result<Self, Malformed> {
        let mut entries = Entries::default();
        let mut offset = skipped;
        let mut line = 0;
        loop {
            line += 1;
            let rest = &bytes[offset..bytes.len().min(skipped + MAX_HEADER)];
            let Some(end) = rest.iter().position(|&b| b == b'\n') else {
                let cause = if bytes.is_empty() {
                    "the file is empty"
                } else {
                    "the header ends before its DATA line"
                };
                return malformed(Place::Line(line), cause);
            };
            // What is not UTF-8 can only be in a comment or make an entry wrong.
            let text = String::from_utf8_lossy(&rest[..end]);
            offset += end + 1;
            let mut tokens =
                text.split('#').next().unwrap_or("").split_ascii_whitespace().map(str::to_owned);
            let Some(key) = tokens.next() else { continue };
            let key = key.to_ascii_uppercase();
            let last = key == "DATA";
            entries.0.push((key, line, tokens.collect()));
            if last {
                break;
            }
        }
        Self::from_entries(&entries, offset, line, warnings)
    }

    fn from_entries(
        entries: &Entries,
        body: usize,
        lines: usize,
        warnings: &mut Vec<ScanWarning>,
    ) -> Result<Self, Malformed> {
        let (fields_line, names) = entries.get("FIELDS").or_else(|_| entries.get("COLUMNS"))?;
        if names.is_empty() {
            return malformed(fields_line, "FIELDS names no field");
        }
        let sizes = entries.per_field("SIZE", names.len())?;
        let kinds = entries.per_field("TYPE", names.len())?;
        let counts = match entries.get("COUNT") {
            Ok(_) => entries.per_field("COUNT", names.len())?.1,
            Err(_) => vec!["1".to_owned(); names.len()],
        };
        let mut fields = Vec::with_capacity(names.len());
        let mut record = 0usize;
        for (index, name) in names.iter().enumerate() {
            let size = parse_count(sizes.0, "SIZE", &sizes.1[index])?;
            let count = parse_count(lines_of(entries, "COUNT", lines), "COUNT", &counts[index])?;
            let kind = match (kinds.1[index].as_str(), size) {
                ("F", 4 | 8) => Kind::Float,
                ("I", 1 | 2 | 4 | 8) => Kind::Signed,
                ("U", 1 | 2 | 4 | 8) => Kind::Unsigned,
                (kind, _) => {
                    let cause = format!("field {name:?} has TYPE {kind:?} with SIZE {size}");
                    return malformed(kinds.0, cause);
                }
            };
            // The reference reader takes a count of 0 for 1.
            let count = count.max(1);
            record = size
                .checked_mul(count)
                .and_then(|bytes| record.checked_add(bytes))
                .ok_or_else(|| Malformed {
                    place: fields_line,
                    cause: format!("field {name:?} is longer than any memory"),
                })?;
            fields.push(Field { name: name.clone(), kind, size, count });
        }
        let find = |wanted: &str| {
            fields.iter().position(|f| f.count == 1 && f.name.eq_ignore_ascii_case(wanted))
        };
        let triple = |a, b, c| Some([find(a)?, find(b)?, find(c)?]);
        let Some(position) = triple("x", "y", "z") else {
            let cause = format!("no fields x, y, z among {}", names.join(", "));
            return malformed(fields_line, cause);
        };
        let normal =
            triple("normal_x", "normal_y", "normal_z").or_else(|| triple("nx", "ny", "nz"));
        let colour = find("rgb").or_else(|| find("rgba")).filter(|&f| fields[f].size == 4);
        let points = Self::points(entries, warnings)?;
        let (data_line, data) = entries.get("DATA")?;
        let encoding = match data.first().map(String::as_str) {
            Some("ascii") => Encoding::Ascii,
            Some("binary") => Encoding::Binary,
            Some("binary_compressed") => Encoding::Compressed,
            other => {
                let cause = format!(
                    "DATA {} is neither ascii, binary nor binary_compressed",
                    other.unwrap_or("(nothing)")
                );
                return malformed(data_line, cause);
            }
        };
        if let Some(field) = colour.filter(|_| encoding != Encoding::Ascii) {
            fields[field].kind = Kind::Unsigned;
        }
        Ok(Self {
            fields,
            points,
            encoding,
            viewpoint: Self::viewpoint(entries)?,
            position,
            normal,
            colour,
            record,
            body,
            lines,
        })
    }

    /// POINTS, or WIDTH times HEIGHT; a line that is not there is told where others give it.
    fn points(entries: &Entries, warnings: &mut Vec<ScanWarning>) -> Result<usize, Malformed> {
        let count = |key: &'static str| match entries.get(key) {
            Err(_) => Ok(None),
            Ok((place, _)) => parse_count(place, key, &entries.single(key)?.1).map(Some),
        };
        let (points, width, height) = (count("POINTS")?, count("WIDTH")?, count("HEIGHT")?);
        let mut inferred = |key, value| {
            warnings.push(ScanWarning::Inferred { key, value });
            Ok(value)
        };
        match (points, width, height) {
            (Some(points), Some(width), Some(height)) => {
                if width.checked_mul(height) == Some(points) {
                    return Ok(points);
                }
                let cause = format!("POINTS {points} is not WIDTH {width} times HEIGHT {height}");
                malformed(entries.get("POINTS")?.0, cause)
            }
            (None, Some(width), Some(height)) => match width.checked_mul(height) {
                Some(points) => inferred("POINTS", points),
                None => malformed(entries.get("WIDTH")?.0, "more points than any file holds"),
            },
            (Some(points), _, None) => {
                inferred("HEIGHT", 1)?;
                Ok(points)
            }
            (Some(points), None, Some(_)) => {
                inferred("WIDTH", points)?;
                Ok(points)
            }
            (None, Some(width), None) => inferred("POINTS", width),
            (None, None, _) => entries.get("POINTS").map(|_| 0),
        }
    }

    fn viewpoint(entries: &Entries) -> Result<Option<Isometry3<f64>>, Malformed> {
        let Ok((place, tokens)) = entries.get("VIEWPOINT") else { return Ok(None) };
        let values: Vec<f64> = tokens.iter().filter_map(|t| t.parse().ok()).collect();
        let [tx, ty, tz, qw, qx, qy, qz] = values[..] else {
            let cause = format!(
                "VIEWPOINT {} is not seven numbers: tx ty tz qw qx qy qz",
                tokens.join(" ")
            );
            return malformed(place, cause);
        };
        let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-6);
        match rotation {
            Some(rotation) if values.iter().all(|v| v.is_finite()) => {
                let pose = Isometry3::from_parts(Translation3::new(tx, ty, tz), rotation);
                Ok((pose != Isometry3::identity()).then_some(pose))
            }
            _ => malformed(place, format!("VIEWPOINT {} is no pose", tokens.join(" "))),
        }
    }
}

/// Header lines: key, line number, values.
#[derive(Default)]
struct Entries(Vec<(String, usize, Vec<String>)>);

impl Entries {
    fn get(&self, key: &str) -> Result<(Place, &[String]), Malformed> {
        let last = Place::Line(self.0.last().map_or(1, |e| e.1));
        match self.0.iter().find(|e| e.0 == key) {
            Some(entry) => Ok((Place::Line(entry.1), &entry.2)),
            None => malformed(last, format!("the header has no {key} line")),
        }
    }

    fn single(&self, key: &str) -> Result<(Place, String), Malformed> {
        let (place, values) = self.get(key)?;
        match values {
            [value] => Ok((place, value.clone())),
            _ => malformed(place, format!("{key} has {} values, one is needed", values.len())),
        }
    }

    fn per_field(&self, key: &str, fields: usize) -> Result<(Place, Vec<String>), Malformed> {
        let (place, values) = self.get(key)?;
        if values.len() != fields {
            let cause = format!("{key} has {} values for {fields} fields", values.len());
            return malformed(place, cause);
        }
        Ok((place, values.to_vec()))
    }
}

fn lines_of(entries: &Entries, key: &str, fallback: usize) -> Place {
    entries.get(key).map_or(Place::Line(fallback), |e| e.0)
}

fn parse_count(place: Place, key: &str, token: &str) -> Result<usize, Malformed> {
    token.parse().or_else(|_| malformed(place, format!("{key} {token} is not a count")))
}

fn ascii(bytes: &[u8], header: &Header, parsed: &mut Parsed) -> Result<(), Malformed> {
    let values: usize = header.fields.iter().map(|f| f.count).sum();
    let mut first = Vec::with_capacity(header.fields.len());
    header.fields.iter().fold(0, |at, field| {
        first.push(at);
        at + field.count
    });
    let mut row = Vec::new();
    let mut line = header.lines;
    for text in bytes[header.body..].split(|&b| b == b'\n') {
        line += 1;
        let place = Place::Line(line);
        let text = std::str::from_utf8(text).or_else(|e| {
            malformed(place, format!("0x{:02x} is not text (UTF-8)", text[e.valid_up_to()]))
        })?;
        let mut tokens = text.split_ascii_whitespace().peekable();
        if tokens.peek().is_none() {
            continue;
        }
        if parsed.points.len() == header.points {
            parsed.warnings.push(ScanWarning::TrailingData { place });
            return Ok(());
        }
        row.clear();
        for token in tokens {
            row.push(number(token).ok_or_else(|| Malformed {
                place,
                cause: format!("{token:?} is not a number (rows are blank-separated)"),
            })?);
        }
        if row.len() != values {
            return malformed(place, format!("{} values where {values} are due", row.len()));
        }
        push(parsed, header, |field| row[first[field]]);
    }
    if parsed.points.len() < header.points {
        let cause = format!(
            "the file ends after {} of the {} points announced",
            parsed.points.len(),
            header.points
        );
        return malformed(Place::Line(line), cause);
    }
    Ok(())
}

fn binary(bytes: &[u8], header: &Header, parsed: &mut Parsed) -> Result<(), Malformed> {
    let body = &bytes[header.body..];
    let needed = body_size(header)?;
    if body.len() < needed {
        let cause = format!(
            "the file ends after {} of the {} points of {} bytes announced",
            body.len() / header.record,
            header.points,
            header.record
        );
        return malformed(Place::Byte(bytes.len()), cause);
    }
    if body.len() > needed {
        let place = Place::Byte(header.body + needed);
        parsed.warnings.push(ScanWarning::TrailingData { place });
    }
    let offsets = offsets(header, 1);
    for record in body[..needed].chunks_exact(header.record) {
        push(parsed, header, |field| header.fields[field].value(&record[offsets[field]..]));
    }
    Ok(())
}

fn compressed(bytes: &[u8], header: &Header, parsed: &mut Parsed) -> Result<(), Malformed> {
    let body = &bytes[header.body..];
    let place = Place::Byte(header.body);
    let (Some(packed), Some(unpacked)) = (u32_at(body, 0), u32_at(body, 4)) else {
        return malformed(Place::Byte(bytes.len()), "the file ends before the compressed sizes");
    };
    let needed = body_size(header)?;
    if unpacked != needed {
        let cause = format!("{unpacked} bytes uncompressed, but the header needs {needed}");
        return malformed(place, cause);
    }
    let data = &body[8..];
    if data.len() < packed {
        let cause = format!("{} of {packed} compressed bytes are there", data.len());
        return malformed(Place::Byte(bytes.len()), cause);
    }
    if needed == 0 {
        return Ok(());
    }
    if needed > packed.saturating_mul(MAX_LZF_RATIO) {
        let cause = format!("{packed} bytes cannot unpack to {needed}");
        return malformed(place, cause);
    }
    let columns = lzf::decompress(&data[..packed], needed).or_else(|e| {
        malformed(Place::Byte(header.body + 8), format!("the compressed data is damaged: {e}"))
    })?;
    if columns.len() != needed {
        let cause = format!("unpacks to {} bytes, {needed} are due", columns.len());
        return malformed(Place::Byte(header.body + 8), cause);
    }
    // Unlike binary, the compressed body stores one field after the other.
    let starts = offsets(header, header.points);
    for point in 0..header.points {
        push(parsed, header, |field| {
            let f = &header.fields[field];
            f.value(&columns[starts[field] + point * f.size * f.count..])
        });
    }
    Ok(())
}

/// The size of the uncompressed body. \[byte\]
fn body_size(header: &Header) -> Result<usize, Malformed> {
    header.points.checked_mul(header.record).ok_or_else(|| Malformed {
        place: Place::Line(header.lines),
        cause: format!("{} points are more than any file holds", header.points),
    })
}

/// Where each field begins when every field before it is there `repeat` times. \[byte\]
fn offsets(header: &Header, repeat: usize) -> Vec<usize> {
    let mut at = 0;
    let start = |field: &Field| {
        let here = at;
        at += field.size * field.count * repeat;
        here
    };
    header.fields.iter().map(start).collect()
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes(word.try_into().ok()?) as usize)
}

fn push(parsed: &mut Parsed, header: &Header, value: impl Fn(usize) -> f64) {
    let [x, y, z] = header.position;
    parsed.points.push(Point3::new(value(x), value(y), value(z)));
    if let Some([x, y, z]) = header.normal {
        parsed.normals.push(Vector3::new(value(x), value(y), value(z)));
    }
    parsed.colours.extend(header.colour.map(|field| unpacked(value(field))));
}
