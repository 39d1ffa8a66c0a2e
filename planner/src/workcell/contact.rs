//! The pad's place on the surface: headings and contact poses.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3};

/// Two unit tangents that form a right-handed frame with the normal, a continuous function of
/// it but at one pole.
#[must_use]
pub fn tangents(normal: &UnitVector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let pole = if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let first = pole.cross(normal).normalize();
    (first, normal.cross(&first))
}

/// The unit tangent at a heading. \[rad\]
#[must_use]
pub fn direction(normal: &UnitVector3<f64>, heading: f64) -> Vector3<f64> {
    let (e1, e2) = tangents(normal);
    e1 * libm::cos(heading) + e2 * libm::sin(heading)
}

/// The heading of a direction, which is projected onto the tangent plane. \[rad\], (−π, π]
#[must_use]
pub fn heading_of(normal: &UnitVector3<f64>, direction: &Vector3<f64>) -> f64 {
    let (e1, e2) = tangents(normal);
    libm::atan2(direction.dot(&e2), direction.dot(&e1))
}

/// The contact frame's pose: origin `stand_off` above the surface point, z against the normal,
/// x along `travel` (projected onto the tangent plane).
#[must_use]
pub fn contact_pose(
    point: &Point3<f64>,
    normal: &UnitVector3<f64>,
    travel: &Vector3<f64>,
    stand_off: f64,
) -> Isometry3<f64> {
    let z = -normal.into_inner();
    let x = (travel - z * travel.dot(&z)).normalize();
    let y = z.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Isometry3::from_parts(
        (point + normal.into_inner() * stand_off).into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heading_and_direction_are_inverse() {
        for k in 0..40 {
            let a = f64::from(k);
            let normal = UnitVector3::new_normalize(Vector3::new(
                libm::sin(a),
                libm::cos(a * 1.7),
                0.9 - 0.05 * a,
            ));
            let heading = (a * 0.37).rem_euclid(6.0) - 3.0;
            let d = direction(&normal, heading);
            assert!((heading_of(&normal, &d) - heading).abs() < 1e-12);
            let pose = contact_pose(&Point3::origin(), &normal, &d, 0.01);
            assert!((pose * Vector3::x() - d).norm() < 1e-12);
            assert!((pose * Vector3::z() + normal.into_inner()).norm() < 1e-12);
            assert!((pose.translation.vector - normal.into_inner() * 0.01).norm() < 1e-12);
        }
    }
}
