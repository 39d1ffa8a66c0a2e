//! A box that says what of a scan is wanted.

use std::str::FromStr;

use nalgebra::Point3;

/// An axis-aligned box, bounds included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CropBox {
    /// Least corner. \[m\]
    pub min: Point3<f64>,
    /// Greatest corner. \[m\]
    pub max: Point3<f64>,
}

impl CropBox {
    /// Whether the box holds a point.
    #[must_use]
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|axis| self.min[axis] <= point[axis] && point[axis] <= self.max[axis])
    }
}

impl FromStr for CropBox {
    type Err = String;

    /// Parses `xmin,ymin,zmin,xmax,ymax,zmax`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let values: Vec<f64> = text
            .split(',')
            .map(|v| v.trim().parse().map_err(|_| format!("{v:?} is not a number")))
            .collect::<Result<_, _>>()?;
        let [a, b, c, d, e, f] = values[..] else {
            return Err(format!(
                "{} numbers where xmin,ymin,zmin,xmax,ymax,zmax is needed",
                values.len()
            ));
        };
        let region = Self { min: Point3::new(a, b, c), max: Point3::new(d, e, f) };
        if (0..3).all(|axis| region.min[axis] < region.max[axis]) {
            Ok(region)
        } else {
            Err(format!(
                "minima {a}, {b}, {c} and maxima {d}, {e}, {f}: each minimum must lie below its \
                 maximum"
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crop_box_reads_and_refuses() {
        let region: CropBox = "-1,-1,0.3,1,1,0.6".parse().unwrap();
        assert!(region.contains(&Point3::new(0.0, 0.0, 0.3)));
        assert!(!region.contains(&Point3::new(0.0, 0.0, 0.61)));
        assert!("0,0,0,1,1".parse::<CropBox>().is_err());
        assert!("0,0,0,1,1,0".parse::<CropBox>().is_err());
    }
}
