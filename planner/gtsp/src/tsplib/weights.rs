//! TSPLIB's edge weights: distance functions of coordinates and explicit matrices.

/// `EDGE_WEIGHT_TYPE`: how weights follow from coordinates (Reinelt, TSPLIB 95, section 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WeightType {
    /// Given in the file.
    Explicit,
    /// Euclidean in the plane, rounded to the nearest integer.
    Euc2d,
    /// Euclidean in space, rounded to the nearest integer.
    Euc3d,
    /// Largest coordinate difference in the plane, rounded.
    Max2d,
    /// Largest coordinate difference in space, rounded.
    Max3d,
    /// Manhattan distance in the plane, rounded.
    Man2d,
    /// Manhattan distance in space, rounded.
    Man3d,
    /// Euclidean in the plane, rounded up.
    Ceil2d,
    /// Euclidean in the plane, rounded down.
    Floor2d,
    /// Great-circle distance in km of latitudes and longitudes in degrees.minutes.
    Geo,
    /// Pseudo-Euclidean distance of att48 and att532.
    Att,
}

impl WeightType {
    /// The type of this name; `None` for those without a formula here (XRAY1, XRAY2, SPECIAL).
    pub(super) fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "EXPLICIT" => Self::Explicit,
            "EUC_2D" => Self::Euc2d,
            "EUC_3D" => Self::Euc3d,
            "MAX_2D" => Self::Max2d,
            "MAX_3D" => Self::Max3d,
            "MAN_2D" => Self::Man2d,
            "MAN_3D" => Self::Man3d,
            "CEIL_2D" => Self::Ceil2d,
            "FLOOR_2D" => Self::Floor2d,
            "GEO" => Self::Geo,
            "ATT" => Self::Att,
            _ => return None,
        })
    }

    /// Numbers that a node's coordinates consist of.
    pub(super) fn dimensions(self) -> usize {
        match self {
            Self::Explicit => 0,
            Self::Euc3d | Self::Max3d | Self::Man3d => 3,
            _ => 2,
        }
    }

    /// Distance of two points; 0 for explicit weights.
    pub(super) fn distance(self, a: [f64; 3], b: [f64; 3]) -> f64 {
        let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let squares = d[0] * d[0] + d[1] * d[1];
        let nearest = |x: f64| (x + 0.5).floor();
        match self {
            Self::Explicit => 0.0,
            Self::Euc2d => nearest(squares.sqrt()),
            Self::Euc3d => nearest((squares + d[2] * d[2]).sqrt()),
            Self::Max2d => nearest(d[0].abs()).max(nearest(d[1].abs())),
            Self::Max3d => d.iter().map(|x| nearest(x.abs())).fold(0.0, f64::max),
            Self::Man2d => nearest(d[0].abs() + d[1].abs()),
            Self::Man3d => nearest(d.iter().map(|x| x.abs()).sum()),
            Self::Ceil2d => squares.sqrt().ceil(),
            Self::Floor2d => squares.sqrt().floor(),
            Self::Geo => geographical(a, b),
            Self::Att => (squares / 10.0).sqrt().ceil(),
        }
    }
}

/// TSPLIB's own value of pi.
#[allow(clippy::approx_constant)] // every published GEO optimum rests on it
const TSPLIB_PI: f64 = 3.141592;
/// TSPLIB's earth radius [km].
const EARTH: f64 = 6378.388;

fn geographical(a: [f64; 3], b: [f64; 3]) -> f64 {
    // The integer part counts degrees, the two decimals minutes.
    let radians = |x: f64| {
        let degrees = x.trunc();
        TSPLIB_PI * (degrees + 5.0 * (x - degrees) / 3.0) / 180.0
    };
    let (lat, lon) = ([radians(a[0]), radians(b[0])], [radians(a[1]), radians(b[1])]);
    let q1 = libm::cos(lon[0] - lon[1]);
    let q2 = libm::cos(lat[0] - lat[1]);
    let q3 = libm::cos(lat[0] + lat[1]);
    (EARTH * libm::acos(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3)) + 1.0).trunc()
}

/// `EDGE_WEIGHT_FORMAT`: which entries of the matrix a file lists, in which order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WeightFormat {
    /// All of it, row by row.
    FullMatrix,
    /// A triangle: above the diagonal or below it, with the diagonal or without, by rows or columns.
    Triangle {
        /// Above the diagonal.
        upper: bool,
        /// The diagonal is listed.
        diagonal: bool,
        /// Listed row by row.
        rows: bool,
    },
}

impl WeightFormat {
    /// The format of this name; `None` for FUNCTION and unknown ones.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        let triangle = |upper, diagonal, rows| Some(Self::Triangle { upper, diagonal, rows });
        match name {
            "FULL_MATRIX" => Some(Self::FullMatrix),
            "UPPER_ROW" => triangle(true, false, true),
            "LOWER_ROW" => triangle(false, false, true),
            "UPPER_DIAG_ROW" => triangle(true, true, true),
            "LOWER_DIAG_ROW" => triangle(false, true, true),
            "UPPER_COL" => triangle(true, false, false),
            "LOWER_COL" => triangle(false, false, false),
            "UPPER_DIAG_COL" => triangle(true, true, false),
            "LOWER_DIAG_COL" => triangle(false, true, false),
            _ => None,
        }
    }

    /// Entries listed for `n` nodes.
    pub(super) fn entries(self, n: usize) -> usize {
        match self {
            Self::FullMatrix => n * n,
            Self::Triangle { diagonal: true, .. } => n * (n + 1) / 2,
            Self::Triangle { diagonal: false, .. } => n * n.saturating_sub(1) / 2,
        }
    }

    /// The full row-major matrix of a list of entries.
    pub(super) fn expand<T: Copy + Default>(self, n: usize, entries: Vec<T>) -> Vec<T> {
        let Self::Triangle { upper, diagonal, rows } = self else { return entries };
        let mut matrix = vec![T::default(); n * n];
        let mut list = entries.into_iter();
        // The columns of the upper triangle are the rows of the lower one of a symmetric matrix.
        let upper_rows = upper == rows;
        for i in 0..n {
            let skip = usize::from(!diagonal);
            let range = if upper_rows { i + skip..n } else { 0..i + 1 - skip };
            for (j, value) in range.zip(&mut list) {
                matrix[i * n + j] = value;
                matrix[j * n + i] = value;
            }
        }
        matrix
    }
}
