//! How exactly a pose is to be met.

use std::str::FromStr;

/// How far the tool may be from a pose and still meet it.
///
/// Along and about the axes of the pose: x, y, z \[m\], then the tilt of the tool's z axis about x
/// and y and the turn about z \[rad\], each to either side; infinite: free. Where both tilts are
/// bounded they are the half angles of an elliptic cone, of a round one where they are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance(pub [f64; 6]);

impl Tolerance {
    /// Position and axis of the tool exact, the turn about its axis free.
    pub const AXIS: Self = Self([0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY]);
}

impl Tolerance {
    /// What is met nearest to an offset, in the same six coordinates.
    pub(crate) fn nearest(&self, off: &[f64; 6]) -> [f64; 6] {
        let mut met: [f64; 6] = std::array::from_fn(|k| off[k].clamp(-self.0[k], self.0[k]));
        let (rx, ry) = (self.0[3], self.0[4]);
        if rx > 0.0 && ry > 0.0 && rx.is_finite() && ry.is_finite() {
            let beyond = libm::hypot(off[3] / rx, off[4] / ry).max(1.0);
            met[3] = off[3] / beyond;
            met[4] = off[4] / beyond;
        }
        met
    }
}

impl FromStr for Tolerance {
    type Err = String;

    /// Six numbers, comma-separated, or `free`.
    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<f64> = text
            .split(',')
            .map(|part| match part.trim() {
                "free" => Ok(f64::INFINITY),
                number => match number.parse::<f64>() {
                    Ok(value) if value >= 0.0 => Ok(value),
                    _ => Err(format!("`{number}`: a number of at least 0, or `free`, is wanted")),
                },
            })
            .collect::<Result<_, _>>()?;
        parts
            .try_into()
            .map(Self)
            .map_err(|v: Vec<f64>| format!("{} numbers, not 6: X,Y,Z,RX,RY,RZ", v.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_tilts_are_a_cone() {
        let cone = Tolerance([0.0, 0.1, f64::INFINITY, 0.2, 0.2, 0.0]);
        let met = cone.nearest(&[1.0, 0.05, 3.0, 0.3, -0.4, 0.1]);
        let tilt = libm::hypot(met[3], met[4]);
        assert!((tilt - 0.2).abs() < 1e-12 && (met[3] - 0.12).abs() < 1e-12, "{met:?}");
        assert_eq!((met[0], met[1], met[2], met[5]), (0.0, 0.05, 3.0, 0.0));
        // One alone is to either side.
        let roll = Tolerance([0.0, 0.0, 0.0, 0.2, 0.0, 0.0]);
        assert_eq!(roll.nearest(&[0.0, 0.0, 0.0, 0.3, 0.3, 0.0])[3..5], [0.2, 0.0]);
        assert_eq!(cone.nearest(&[0.0, 0.0, 0.0, 0.1, 0.1, 0.0])[3..5], [0.1, 0.1]);
    }

    #[test]
    fn reads_tolerances() {
        let wok: Tolerance = "0.05,0.05,0,0,0,free".parse().unwrap();
        assert_eq!(wok, Tolerance([0.05, 0.05, 0.0, 0.0, 0.0, f64::INFINITY]));
        assert!("1,2,3".parse::<Tolerance>().is_err());
        assert!("0,0,0,0,0,-1".parse::<Tolerance>().is_err());
    }
}
