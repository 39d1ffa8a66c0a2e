//! Which columns of a table are x, y, z and the normal, and in which unit.

use super::warning::ScanWarning;

/// The columns that are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Columns {
    pub(super) position: [usize; 3],
    /// From each column's unit to the file's.
    pub(super) factors: [f64; 3],
    pub(super) normal: Option<[usize; 3]>,
    pub(super) colour: Option<[usize; 3]>,
}

impl Columns {
    /// Columns in the order x, y, z, from `first` on.
    pub(super) fn in_order(first: usize, normal: bool) -> Self {
        let three = |from| [from, from + 1, from + 2];
        let normal = normal.then(|| three(first + 3));
        Self { position: three(first), factors: [1.0; 3], normal, colour: None }
    }

    /// The columns that are named so; `None` where x, y and z are not all among the names.
    pub(super) fn named(names: &[&str], warnings: &mut Vec<ScanWarning>) -> Option<Self> {
        let names: Vec<Name> = names.iter().map(|name| Name::of(name)).collect();
        let find = |wanted: [&[&str]; 3]| {
            let mut found = [0; 3];
            for (column, wanted) in found.iter_mut().zip(wanted) {
                // In the order of the ways of writing, as "x" is x where "pos_x" is there too.
                *column = wanted.iter().find_map(|w| names.iter().position(|n| n.text == *w))?;
            }
            Some(found)
        };
        let position = find(POSITION)?;
        let units = position.map(|column| names[column].unit.as_deref());
        let factors = units.map(|unit| unit.map_or(Some(1.0), factor));
        for (unit, factor) in units.iter().zip(factors) {
            let warning = match (unit, factor) {
                (Some(unit), Some(factor)) if factor != 1.0 => {
                    ScanWarning::Unit { unit: (*unit).to_owned(), factor }
                }
                (Some(unit), None) => ScanWarning::UnknownUnit { unit: (*unit).to_owned() },
                _ => continue,
            };
            if !warnings.contains(&warning) {
                warnings.push(warning);
            }
        }
        let factors = factors.map(|factor| factor.unwrap_or(1.0));
        Some(Self { position, factors, normal: find(NORMAL), colour: find(COLOUR) })
    }

    /// The same, with a column before the named ones.
    pub(super) fn shifted(self) -> Self {
        let shift = |columns: [usize; 3]| columns.map(|column| column + 1);
        let [normal, colour] = [self.normal, self.colour].map(|columns| columns.map(shift));
        Self { position: shift(self.position), normal, colour, ..self }
    }
}

/// How x, y, z are called, without signs between words: plain, ParaView's, those of other programs.
const POSITION: [&[&str]; 3] = [
    &["x", "points0", "pointsx", "pointx", "positionx", "posx", "coordinatex", "coordx", "px"],
    &["y", "points1", "pointsy", "pointy", "positiony", "posy", "coordinatey", "coordy", "py"],
    &["z", "points2", "pointsz", "pointz", "positionz", "posz", "coordinatez", "coordz", "pz"],
];

const NORMAL: [&[&str]; 3] = [
    &["nx", "normalx", "normalsx", "normal0", "normals0", "xnormal"],
    &["ny", "normaly", "normalsy", "normal1", "normals1", "ynormal"],
    &["nz", "normalz", "normalsz", "normal2", "normals2", "znormal"],
];

const COLOUR: [&[&str]; 3] =
    [&["red", "r", "rgb0"], &["green", "g", "rgb1"], &["blue", "b", "rgb2"]];

/// A column's name, in lower-case letters and digits alone, with its unit apart.
struct Name {
    text: String,
    unit: Option<String>,
}

impl Name {
    fn of(name: &str) -> Self {
        let name = name.trim_matches(|c: char| c.is_whitespace() || "\"'".contains(c));
        let (name, unit) = match name.find(['[', '(', '{', '/']) {
            Some(at) => {
                let unit = name[at + 1..].trim_matches(|c: char| !c.is_alphanumeric());
                (&name[..at], Some(unit).filter(|unit| !unit.is_empty()))
            }
            None => match name.rsplit_once(['_', ' ']) {
                // "x_mm", but not the "y" of "pos_y".
                Some((head, tail)) if factor(tail).is_some() => (head, Some(tail)),
                _ => (name, None),
            },
        };
        let text = name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase();
        Self { text, unit: unit.map(str::to_lowercase) }
    }
}

/// From a unit to metres.
fn factor(unit: &str) -> Option<f64> {
    Some(match unit.to_lowercase().as_str() {
        "m" | "meter" | "meters" | "metre" | "metres" => 1.0,
        "dm" => 0.1,
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => 0.01,
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 0.001,
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometre" => 1e-6,
        "km" => 1000.0,
        "in" | "inch" | "inches" => 0.0254,
        "ft" | "foot" | "feet" => 0.3048,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &str) -> Option<(Columns, Vec<ScanWarning>)> {
        let names: Vec<&str> = names.split(',').collect();
        let mut warnings = Vec::new();
        Columns::named(&names, &mut warnings).map(|columns| (columns, warnings))
    }

    #[test]
    fn names_decide_whoever_wrote_them() {
        for (names, position, normal) in [
            ("x,y,z", [0, 1, 2], None),
            (
                "\"Points:0\",\"Points:1\",\"Points:2\",\"Normals:0\",\"Normals:1\",\"Normals:2\"",
                [0, 1, 2],
                Some([3, 4, 5]),
            ),
            (",z,y,x", [3, 2, 1], None),
            ("pos_x,pos_y,pos_z,x,y,z", [3, 4, 5], None),
            ("NX,NY,NZ,X,Y,Z", [3, 4, 5], Some([0, 1, 2])),
            ("Points_0,Points_1,Points_2,Normal X,Normal Y,Normal Z", [0, 1, 2], Some([3, 4, 5])),
            ("time,position.x,position.y,position.z", [1, 2, 3], None),
        ] {
            let (columns, warnings) = named(names).unwrap_or_else(|| panic!("{names}"));
            assert_eq!((columns.position, columns.normal), (position, normal), "{names}");
            assert_eq!(warnings, [], "{names}");
        }
        for names in ["a,b,c", "x,y", "lat,lon,alt", "red,green,blue"] {
            assert_eq!(named(names), None, "{names}");
        }
    }

    #[test]
    fn units_beside_the_names_scale_and_are_told() {
        for names in ["X [mm],Y [mm],Z [mm]", "x_mm,y_mm,z_mm", "x(mm),y (mm),z/mm"] {
            let (columns, warnings) = named(names).unwrap();
            assert_eq!(columns.factors, [0.001; 3], "{names}");
            assert_eq!(warnings, [ScanWarning::Unit { unit: "mm".into(), factor: 0.001 }]);
        }
        let (columns, warnings) = named("X [m],Y [m],Z [m]").unwrap();
        assert_eq!((columns.factors, warnings.len()), ([1.0; 3], 0));
        let (columns, warnings) = named("x [px],y [px],z [mm]").unwrap();
        assert_eq!(columns.factors, [1.0, 1.0, 0.001]);
        assert_eq!(warnings.len(), 2);
    }
}
