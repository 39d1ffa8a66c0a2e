//! What is worth saying of a scan though it is accepted.

use std::fmt;

use super::error::Place;

/// Something about a scan that its user should know, though it was accepted.
#[derive(Clone, Debug, PartialEq)]
pub enum ScanWarning {
    /// The extent suggests that the file is not in metres.
    LooksLikeMillimetres {
        /// Longest side of the bounding box. \[m\]
        extent: f64,
    },
    /// Points were dropped as NaN or infinite; depth cameras mark missing pixels so, tables leave
    /// their cells empty.
    NonFinite {
        /// How many.
        dropped: usize,
    },
    /// Points were dropped at the sensor itself, where depth cameras put missing pixels.
    AtOrigin {
        /// How many.
        dropped: usize,
    },
    /// Points were dropped that lie far from all others.
    Stray {
        /// How many.
        dropped: usize,
        /// Where the farthest is, in the file's frame. \[m\]
        farthest: [f64; 3],
        /// How far that is from the middle of the others. \[m\]
        distance: f64,
    },
    /// The file goes on after the points that its header announces.
    TrailingData {
        /// Where the surplus begins.
        place: Place,
    },
    /// A count at the top of the file is not that of its points.
    CountDiffers {
        /// What it says.
        announced: usize,
        /// How many points follow.
        found: usize,
    },
    /// A header lacks a line that follows from others.
    Inferred {
        /// Which line.
        key: &'static str,
        /// What it was taken to be.
        value: usize,
    },
    /// A text mesh ends after a whole face, without its last line.
    NoEnd,
    /// Records stand on more than one line each.
    BrokenLines {
        /// The first such line.
        place: Place,
    },
    /// The text is not UTF-8; it was taken for Latin-1.
    NotUtf8 {
        /// The first byte that tells.
        place: Place,
    },
    /// A line before the points that names no columns.
    LineSkipped {
        /// Which one.
        place: Place,
    },
    /// A table's columns have no names.
    Unnamed {
        /// The column that was taken for x, counted from 1.
        first: usize,
        /// What the columns after z were taken for.
        rest: Rest,
    },
    /// A first column without a name was taken for the rows' index.
    IndexColumn,
    /// A table has not as many names as columns.
    OtherNames {
        /// How many names.
        names: usize,
        /// How many columns.
        columns: usize,
    },
    /// The names of the columns say their unit.
    Unit {
        /// Which one.
        unit: String,
        /// From it to metres.
        factor: f64,
    },
    /// The names of the columns say their unit, and the user another one.
    UnitOverruled {
        /// What the names say.
        unit: String,
        /// To metres, from the user.
        scale: f64,
    },
    /// The names of the columns say a unit that is not known.
    UnknownUnit {
        /// Which one.
        unit: String,
    },
    /// A mesh needed a wider sampling than asked for to stay within the point limit.
    SpacingWidened {
        /// The spacing used. \[m\]
        spacing: f64,
    },
    /// Faces of a mesh were taken for the back of others in the same place.
    TwiceCovered {
        /// How many were left out.
        faces: usize,
        /// Of how many.
        of: usize,
    },
    /// Faces of a mesh were turned round so that all look outwards.
    FacesTurned {
        /// How many.
        faces: usize,
        /// Of how many.
        of: usize,
    },
    /// Points of a mesh's file that are in none of its faces were left out.
    NoFace {
        /// How many.
        points: usize,
    },
    /// What closed meshes enclose is so much that the places that stand for it lie wider apart.
    FilledWide {
        /// How far. \[m\]
        apart: f64,
    },
    /// Closed pieces that look inwards, as a room's walls do: what they enclose is not solid.
    LooksInwards {
        /// How many faces they have.
        faces: usize,
        /// Of how many.
        of: usize,
    },
    /// The format says which way is up in its files.
    Upright {
        /// The format.
        format: &'static str,
        /// The direction, in the file's frame.
        up: [f64; 3],
    },
    /// What the format means by its numbers, and what was made of it.
    Convention {
        /// In words.
        told: String,
    },
    /// Which side of a mesh is its outside cannot be told from its shape.
    SideUnknown {
        /// How many faces were left as the file has them.
        faces: usize,
        /// Of how many.
        of: usize,
    },
}

/// What the columns after x, y, z were taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rest {
    /// The normal: they are unit vectors or zero.
    Normals,
    /// A colour: they are no unit vectors.
    Colour,
    /// Nothing.
    Ignored,
}

impl fmt::Display for Rest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Normals => "the last three, unit vectors, for the normal",
            Self::Colour => "the last three, no unit vectors, for a colour",
            Self::Ignored => "the others ignored",
        })
    }
}

impl fmt::Display for ScanWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LooksLikeMillimetres { extent } => {
                write!(f, "the points span {extent:.0} m: are they in millimetres?")
            }
            Self::NonFinite { dropped } => {
                write!(
                    f,
                    "{dropped} points dropped as not finite (pixels without depth, or no value)"
                )
            }
            Self::AtOrigin { dropped } => {
                write!(f, "{dropped} points dropped at 0, 0, 0 (pixels without depth)")
            }
            Self::Stray { dropped, farthest, distance } => write!(
                f,
                "{dropped} stray points dropped, the farthest at {farthest:.3?}, {distance:.3} m from \
                 the middle of the others"
            ),
            Self::TrailingData { place } => {
                write!(
                    f,
                    "data from {place} on ignored: the header announces fewer points or faces"
                )
            }
            Self::CountDiffers { announced, found } => {
                write!(
                    f,
                    "{announced} points are announced, {found} are there; all of these are read"
                )
            }
            Self::Inferred { key, value } => {
                write!(f, "the header has no {key} line: {value} taken, which its other lines give")
            }
            Self::NoEnd => write!(f, "the file ends without its last line (endsolid)"),
            Self::BrokenLines { place } => {
                write!(f, "from {place} on, elements stand on more than one line each")
            }
            Self::NotUtf8 { place } => {
                write!(f, "{place} is not UTF-8: the text was taken for Latin-1")
            }
            Self::LineSkipped { place } => {
                write!(f, "{place} skipped: it is neither a point nor names columns x, y, z")
            }
            Self::Unnamed { first, rest } => {
                let last = first + 2;
                write!(f, "the columns have no names: {first} to {last} taken for x, y, z, {rest}")
            }
            Self::IndexColumn => {
                write!(f, "the first column has no name and was taken for the rows' index")
            }
            Self::OtherNames { names, columns } => {
                write!(f, "{names} names over {columns} columns: taken from the first one on")
            }
            Self::Unit { unit, factor } => {
                write!(f, "the columns' names say [{unit}]: scaled by {factor} to metres")
            }
            Self::UnitOverruled { unit, scale } => {
                write!(f, "the columns' names say [{unit}], but a scale of {scale} was asked for")
            }
            Self::UnknownUnit { unit } => {
                write!(
                    f,
                    "the columns' names say [{unit}], which is no known unit: taken for metres"
                )
            }
            Self::SpacingWidened { spacing } => {
                write!(f, "the mesh is large: sampled every {:.1} mm", spacing * 1e3)
            }
            Self::TwiceCovered { faces, of } => {
                write!(f, "{faces} of {of} faces left out: they cover others, as a back does")
            }
            Self::FacesTurned { faces, of } => {
                write!(f, "{faces} of {of} faces looked inwards and were turned round")
            }
            Self::NoFace { points } => {
                write!(f, "{points} points beside the mesh left out: no face uses them")
            }
            Self::FilledWide { apart } => write!(
                f,
                "closed meshes enclose much: a place every {:.0} mm stands for their inside, which is \
                 none in what is thinner",
                apart * 1e3
            ),
            Self::LooksInwards { faces, of } => write!(
                f,
                "{faces} of {of} faces are of closed pieces that look inwards, as a room's walls do: \
                 what these enclose is taken for free"
            ),
            Self::Upright { format, up: [x, y, z] } => {
                write!(f, "{format} files are in metres and have {x},{y},{z} up")
            }
            Self::Convention { told } => write!(f, "{told}"),
            Self::SideUnknown { faces, of } => write!(
                f,
                "which side is outside cannot be told from the shape for {faces} of {of} faces: left \
                 as their winding says"
            ),
        }
    }
}
