//! Eight scan points at a time against a solid, in single precision: most points near a shape are
//! plainly far enough from it, and only the others are worth an exact look.

use nalgebra::Vector3;
use wide::f32x8;

use crate::frame::Frame;
use crate::solid::Solid;

/// A solid at a pose, with the distance that points should keep from it.
pub(crate) struct Sieve<'a> {
    solid: &'a Solid,
    /// From the points' frame to the solid's.
    rotation: [[f32x8; 3]; 3],
    translation: [f32x8; 3],
    need: f32,
}

/// Planes of a hull between two looks whether all points are beyond one of them.
const PLANES: usize = 6;

impl<'a> Sieve<'a> {
    /// The solid stands at `at`; the points come relative to `origin`, in the same frame. `need`
    /// includes what rounding may take away. \[m\]
    pub(crate) fn new(solid: &'a Solid, at: &Frame, origin: &Vector3<f64>, need: f64) -> Self {
        let translation = at.apply_inverse(origin);
        let splat = |value: f64| f32x8::splat(value as f32);
        Self {
            solid,
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| splat(at.rotation[(j, i)]))),
            translation: std::array::from_fn(|i| splat(translation[i])),
            need: need as f32,
        }
    }

    /// A bit for each point that may be nearer than it should.
    #[inline]
    pub(crate) fn near(&self, points: &[f32x8; 3]) -> u32 {
        let [x, y, z] = std::array::from_fn(|i| {
            let r = &self.rotation[i];
            r[0] * points[0] + r[1] * points[1] + r[2] * points[2] + self.translation[i]
        });
        let beyond = |value: f32x8, edge: f64| (value - edge as f32).fast_max(f32x8::ZERO);
        // Distance squared, and what it should be.
        let (squared, need) = match self.solid {
            Solid::Ball { radius } => (x * x + y * y + z * z, self.need + *radius as f32),
            Solid::Capsule { half, radius } => {
                let z = beyond(z.abs(), *half);
                (x * x + y * y + z * z, self.need + *radius as f32)
            }
            Solid::Cylinder { half, radius } => {
                let radial = beyond((x * x + z * z).sqrt(), *radius);
                let axial = beyond(y.abs(), *half);
                (radial * radial + axial * axial, self.need)
            }
            Solid::Box { half } => {
                let [x, y, z] =
                    [beyond(x.abs(), half.x), beyond(y.abs(), half.y), beyond(z.abs(), half.z)];
                (x * x + y * y + z * z, self.need)
            }
            Solid::Hull(hull) => {
                let (need, mut outside) = (f32x8::splat(self.need), f32x8::ZERO);
                for planes in hull.lanes.chunks(PLANES) {
                    for [a, b, c, offset] in planes {
                        outside = outside.fast_max(x * *a + y * *b + z * *c - *offset);
                    }
                    if outside.simd_ge(need).all() {
                        return 0;
                    }
                }
                (outside * outside, self.need)
            }
            Solid::HalfSpace => {
                let above = beyond(z, 0.0);
                (above * above, self.need)
            }
        };
        squared.simd_lt(f32x8::splat(need * need)).to_bitmask()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::field::Field;
    use crate::mesh::Hull;

    #[test]
    fn no_near_point_is_ruled_out_and_most_far_ones_are() {
        let mut rng = ChaCha8Rng::seed_from_u64(21);
        let corners: Vec<Point3<f64>> = (0..40)
            .map(|_| {
                Point3::from(std::array::from_fn::<f64, 3, _>(|_| rng.random_range(-0.1..0.1)))
            })
            .collect();
        let solids = [
            Solid::Ball { radius: 0.1 },
            Solid::Capsule { half: 0.1, radius: 0.05 },
            Solid::Cylinder { half: 0.1, radius: 0.05 },
            Solid::Box { half: Vector3::new(0.1, 0.05, 0.02) },
            Solid::Hull(Box::new(Hull::new(&corners).unwrap())),
        ];
        // Not a multiple of eight.
        let scan: Vec<Point3<f64>> = (0..4003)
            .map(|_| {
                Point3::new(
                    0.6 + 0.1 * rng.random_range(-1.0..1.0f64),
                    rng.random_range(-0.4..0.4),
                    rng.random_range(0.4..1.0),
                )
            })
            .collect();
        let field = Field::new(&scan, &Vector3::zeros(), 10.0);
        let (mut near, mut asked) = (0, 0);
        for round in 0..500 {
            let solid = &solids[round % solids.len()];
            let mut draw = |most: f64| rng.random_range(-most..most);
            let turn = UnitQuaternion::from_euler_angles(draw(3.0), draw(1.5), draw(3.0));
            let place = Vector3::new(0.6 + draw(0.3), draw(0.6), 0.7 + draw(0.5));
            let at = Frame::from(&Isometry3::from_parts(place.into(), turn));
            let need = rng.random_range(1e-8..0.05);
            let distance = |p: &Vector3<f64>| solid.distance_bound(&at.apply_inverse(p));
            let wanted = scan.iter().filter(|p| distance(&p.coords) < need).count();
            let mut seen = 0;
            let all = field.all_near(solid, &at, need, |p| {
                asked += 1;
                seen += usize::from(distance(p) < need);
                true
            });
            assert!(all);
            assert_eq!(seen, wanted, "round {round}, {need} m");
            near += wanted;
            let stopped = !field.all_near(solid, &at, need, |p| distance(p) >= need);
            assert_eq!(stopped, wanted > 0);
        }
        assert!(near > 10_000, "{near} near points");
        assert!(asked - near < near / 100, "{asked} asked for {near}");
    }
}
