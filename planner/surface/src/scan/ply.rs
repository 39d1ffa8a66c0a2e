//! PLY, points or meshes, through `ply-rs-bw`.

use std::io::Cursor;

use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::colour::of_columns;
use super::decode::{decode, without_bom};
use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::ply_text::Body;
use super::warning::ScanWarning;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let bytes = without_bom(bytes);
    if bytes.is_empty() {
        return malformed(Place::Line(1), "the file is empty");
    }
    // Comments may be in any encoding, of which the parser wants to know nothing.
    let mut plain = Vec::new();
    let mut reader = Reader::new(Cursor::new(match header_end(bytes) {
        Some(end) if std::str::from_utf8(&bytes[..end]).is_err() => {
            plain.extend(bytes[..end].iter().map(|&b| if b.is_ascii() { b } else { b'?' }));
            plain.as_slice()
        }
        _ => bytes,
    }));
    let parser = Parser::<Record>::new();
    let header = parser.read_header(&mut reader).map_err(|e| failure(&e, Place::Line(1)))?;
    let body = usize::try_from(reader.get_ref().position()).unwrap_or(bytes.len());
    check(&header, bytes.len() - body, reader.line())?;
    let lines_before = reader.line().saturating_sub(1);
    let mut source = &bytes[body..];

    let mut parsed = Parsed::default();
    let text = match header.encoding {
        Encoding::Ascii => decode(&bytes[body..], &mut parsed.warnings)?,
        _ => "".into(),
    };
    let mut colours = Vec::new();
    let mut lines = Body::new(&text, lines_before);
    for (name, definition) in &header.elements {
        let has = |names: [&str; 3]| names.iter().all(|n| definition.properties.contains_key(*n));
        let normal = has(["nx", "ny", "nz"]) || has(["normal_x", "normal_y", "normal_z"]);
        let colour = has(["red", "green", "blue"]);
        for _ in 0..definition.count {
            let place = Place::Byte(bytes.len() - source.len());
            let binary = |e: ParseError| Malformed { place, cause: one_line(&e) };
            let record: Record = match header.encoding {
                Encoding::Ascii => lines.element(definition)?,
                Encoding::BinaryBigEndian => {
                    parser.read_big_endian_element(&mut source, definition).map_err(binary)?
                }
                Encoding::BinaryLittleEndian => {
                    parser.read_little_endian_element(&mut source, definition).map_err(binary)?
                }
            };
            match name.as_str() {
                "vertex" => {
                    parsed.points.push(Point3::from(record.position));
                    if normal {
                        parsed.normals.push(Vector3::from(record.normal));
                    }
                    if colour {
                        colours.push(record.colour);
                    }
                }
                "face" => fan(&record.corners, &mut parsed.triangles),
                _ => {}
            }
        }
    }
    parsed.colours = of_columns(&colours);
    if let Some(place) = lines.broken {
        parsed.warnings.push(ScanWarning::BrokenLines { place });
    }
    let end = match header.encoding {
        Encoding::Ascii => lines.place(),
        _ => Place::Byte(bytes.len()),
    };
    let left = match header.encoding {
        Encoding::Ascii => lines.left(),
        _ => {
            let rest = source.trim_ascii();
            (!rest.is_empty()).then(|| Place::Byte(bytes.len() - source.len()))
        }
    };
    if let Some(place) = left {
        parsed.warnings.push(ScanWarning::TrailingData { place });
    }
    // Only now, as faces may stand before the vertices.
    let count = parsed.points.len();
    if let Some(corner) = parsed.triangles.iter().flatten().find(|&&corner| corner >= count) {
        let cause = format!("a face names vertex {corner} of {count}");
        return malformed(end, cause);
    }
    Ok(parsed)
}

/// Where the header's last line ends. \[byte\]
fn header_end(bytes: &[u8]) -> Option<usize> {
    const LAST: &[u8] = b"\nend_header";
    let at = bytes.windows(LAST.len()).position(|window| window == LAST)? + LAST.len();
    Some(at + bytes[at..].iter().position(|&b| b == b'\n')? + 1)
}

/// What is kept of any element; all else is read past.
struct Record {
    position: [f64; 3],
    normal: [f64; 3],
    colour: [f64; 3],
    corners: Vec<u32>,
}

impl PropertyAccess for Record {
    fn new() -> Self {
        let (position, normal, colour) = ([f64::NAN; 3], [0.0; 3], [0.0; 3]);
        Self { position, normal, colour, corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" | "X" => &mut self.position[0],
            "y" | "Y" => &mut self.position[1],
            "z" | "Z" => &mut self.position[2],
            "nx" | "normal_x" => &mut self.normal[0],
            "ny" | "normal_y" => &mut self.normal[1],
            "nz" | "normal_z" => &mut self.normal[2],
            "red" => &mut self.colour[0],
            "green" => &mut self.colour[1],
            "blue" => &mut self.colour[2],
            "vertex_indices" | "vertex_index" => {
                return match property.to_u32_list() {
                    Some(corners) => {
                        self.corners = corners;
                        PropertyAccessResult::Set
                    }
                    None => PropertyAccessResult::UnsupportedType,
                };
            }
            _ => return PropertyAccessResult::Ignored,
        };
        *slot = match property {
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Refuses a header that announces more than the file can hold, before anything is read: an
/// element without properties and a count of 10^18 would otherwise be read for ever.
fn check(header: &Header, body: usize, line: usize) -> Result<(), Malformed> {
    let Some(vertex) = header.elements.get("vertex") else {
        return malformed(Place::Line(line), "the header has no vertex element");
    };
    for axis in ["x", "y", "z"] {
        if !vertex.properties.keys().any(|name| name.eq_ignore_ascii_case(axis)) {
            return malformed(Place::Line(line), format!("vertices have no property {axis}"));
        }
    }
    let mut needed = 0usize;
    for (name, element) in &header.elements {
        let record = match header.encoding {
            // A digit and a line break for each property, and at least the line break.
            Encoding::Ascii => (2 * element.properties.len()).max(1),
            _ => element.properties.iter().map(|(_, p)| least_size(&p.data_type)).sum(),
        };
        if record == 0 && element.count > 0 {
            return malformed(Place::Line(line), format!("element {name} has no properties"));
        }
        needed = record
            .checked_mul(element.count)
            .and_then(|bytes| needed.checked_add(bytes))
            .unwrap_or(usize::MAX);
        // The last line of a text may lack its break.
        if needed > body + 1 {
            let cause = format!(
                "{} of element {name} are announced, but only {body} bytes follow the header",
                element.count
            );
            return malformed(Place::Line(line), cause);
        }
    }
    Ok(())
}

fn least_size(kind: &PropertyType) -> usize {
    let scalar = match kind {
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => scalar,
    };
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Polygons become fans of triangles.
fn fan(corners: &[u32], triangles: &mut Vec<[usize; 3]>) {
    for pair in corners.windows(2).skip(1) {
        triangles.push([corners[0], pair[0], pair[1]].map(|corner| corner as usize));
    }
}

fn failure(error: &ParseError, fallback: Place) -> Malformed {
    let place = error.line().map_or(fallback, Place::Line);
    Malformed { place, cause: one_line(error) }
}

/// The crate's messages span several lines and repeat the place.
fn one_line(error: &ParseError) -> String {
    let text = error.to_string();
    let text = text
        .split_once(": ")
        .filter(|(head, _)| head.starts_with("Line "))
        .map_or(text.as_str(), |(_, rest)| rest);
    let mut line: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((end, _)) = line.char_indices().nth(200) {
        line.truncate(end);
    }
    line
}
