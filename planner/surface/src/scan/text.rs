//! Plain text: x y z, or x y z nx ny nz, one point a line.

use nalgebra::{Point3, Vector3};

use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;

/// Bytes without a leading UTF-8 byte-order mark.
pub(super) fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// The content as text without a byte-order mark, or where it stops being text.
pub(super) fn as_text(bytes: &[u8]) -> Result<&str, Malformed> {
    let content = without_bom(bytes);
    std::str::from_utf8(content).or_else(|e| {
        let value = content[e.valid_up_to()];
        let at = bytes.len() - content.len() + e.valid_up_to();
        malformed(Place::Byte(at), format!("0x{value:02x} is not text (UTF-8)"))
    })
}

/// Lines of comments (`#`, `//`) and one leading line of column names are passed over. With six or
/// more columns named `nx ny nz` in a header, or exactly six columns without a header, the last
/// three are normals; further columns are ignored.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let content = as_text(bytes)?;
    let mut parsed = Parsed::default();
    let mut columns: Option<Columns> = None;
    for (index, line) in content.lines().enumerate() {
        let place = Place::Line(index + 1);
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') || line.starts_with("//") {
            continue;
        }
        let tokens: Vec<&str> = line
            .split([',', ';', ' ', '\t'])
            .map(str::trim)
            .filter(|token| !token.is_empty())
            .collect();
        let columns = match &columns {
            Some(known) => *known,
            None => {
                let names = Columns::from_names(&tokens);
                let first = names.or_else(|| Columns::from_count(tokens.len()));
                let Some(first) = first else {
                    return malformed(
                        place,
                        format!("{} columns where x, y, z are needed", tokens.len()),
                    );
                };
                columns = Some(first);
                if names.is_some() {
                    continue;
                }
                first
            }
        };
        let number = |column: usize| -> Result<f64, Malformed> {
            let Some(token) = tokens.get(column) else {
                return malformed(
                    place,
                    format!("{} numbers where {} are needed", tokens.len(), column + 1),
                );
            };
            token.parse().or_else(|_| malformed(place, format!("{token:?} is not a number")))
        };
        let [x, y, z] = columns.position;
        parsed.points.push(Point3::new(number(x)?, number(y)?, number(z)?));
        if let Some([x, y, z]) = columns.normal {
            parsed.normals.push(Vector3::new(number(x)?, number(y)?, number(z)?));
        }
    }
    Ok(parsed)
}

#[derive(Clone, Copy)]
struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
}

impl Columns {
    fn from_names(tokens: &[&str]) -> Option<Self> {
        let find =
            |name: &str| tokens.iter().position(|t| t.trim_matches('"').eq_ignore_ascii_case(name));
        let all = |names: [&str; 3]| Some([find(names[0])?, find(names[1])?, find(names[2])?]);
        Some(Self {
            position: all(["x", "y", "z"])?,
            normal: all(["nx", "ny", "nz"]).or_else(|| all(["normal_x", "normal_y", "normal_z"])),
        })
    }

    fn from_count(count: usize) -> Option<Self> {
        (count >= 3)
            .then_some(Self { position: [0, 1, 2], normal: (count == 6).then_some([3, 4, 5]) })
    }
}
