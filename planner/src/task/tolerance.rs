//! How exactly a pose is to be met.

use std::str::FromStr;

/// How far the tool may be from a pose and still meet it.
///
/// Along and about the axes of the pose: x, y, z \[m\], then the tilt of the tool's z axis about x
/// and y and the turn about z \[rad\], each to either side; infinite: free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance(pub [f64; 6]);

impl Tolerance {
    /// Position and axis of the tool exact, the turn about its axis free.
    pub const AXIS: Self = Self([0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY]);
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
    fn reads_tolerances() {
        let wok: Tolerance = "0.05,0.05,0,0,0,free".parse().unwrap();
        assert_eq!(wok, Tolerance([0.05, 0.05, 0.0, 0.0, 0.0, f64::INFINITY]));
        assert!("1,2,3".parse::<Tolerance>().is_err());
        assert!("0,0,0,0,0,-1".parse::<Tolerance>().is_err());
    }
}
