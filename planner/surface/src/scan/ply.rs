//! PLY, points or meshes, through `ply-rs-bw`.

use std::io::Cursor;

use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::text::without_bom;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let bytes = without_bom(bytes);
    if bytes.is_empty() {
        return malformed(Place::Line(1), "the file is empty");
    }
    let mut reader = Reader::new(Cursor::new(bytes));
    let parser = Parser::<Record>::new();
    let header = parser.read_header(&mut reader).map_err(|e| failure(&e, Place::Line(1)))?;
    let body = usize::try_from(reader.get_ref().position()).unwrap_or(bytes.len());
    check(&header, bytes.len() - body, reader.line())?;

    let mut parsed = Parsed::default();
    for (name, definition) in &header.elements {
        let from = usize::try_from(reader.get_ref().position()).unwrap_or(bytes.len());
        let records =
            parser.read_payload_for_element(&mut reader, definition, &header).map_err(|e| {
                match header.encoding {
                    Encoding::Ascii => failure(&e, Place::Line(reader.line())),
                    _ => Malformed { place: Place::Byte(from), cause: one_line(&e) },
                }
            })?;
        match name.as_str() {
            "vertex" => vertices(definition, &records, &mut parsed),
            "face" => faces(&records, &mut parsed),
            _ => {}
        }
    }
    // Only now, as faces may stand before the vertices.
    let count = parsed.points.len();
    if let Some(corner) = parsed.triangles.iter().flatten().find(|&&corner| corner >= count) {
        let cause = format!("a face names vertex {corner} of {count}");
        return malformed(Place::Line(reader.line()), cause);
    }
    Ok(parsed)
}

/// What is kept of any element; all else is read past.
struct Record {
    position: [f64; 3],
    normal: [f64; 3],
    corners: Vec<u32>,
}

impl PropertyAccess for Record {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], normal: [0.0; 3], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" | "normal_x" => &mut self.normal[0],
            "ny" | "normal_y" => &mut self.normal[1],
            "nz" | "normal_z" => &mut self.normal[2],
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
        if !vertex.properties.contains_key(axis) {
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

fn vertices(definition: &ElementDef, records: &[Record], parsed: &mut Parsed) {
    parsed.points.extend(records.iter().map(|r| Point3::from(r.position)));
    let has = |name: &str| definition.properties.contains_key(name);
    if ["nx", "ny", "nz"].into_iter().all(has)
        || ["normal_x", "normal_y", "normal_z"].into_iter().all(has)
    {
        parsed.normals.extend(records.iter().map(|r| Vector3::from(r.normal)));
    }
}

/// Polygons become fans of triangles.
fn faces(records: &[Record], parsed: &mut Parsed) {
    for record in records {
        for pair in record.corners.windows(2).skip(1) {
            let triangle = [record.corners[0], pair[0], pair[1]];
            parsed.triangles.push(triangle.map(|corner| corner as usize));
        }
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
