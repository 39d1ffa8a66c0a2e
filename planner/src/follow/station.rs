//! The places of a path.

use nalgebra::Isometry3;

/// Two neighbouring places are at most this far apart \[m\], and so much turned \[rad\].
const SPACING: f64 = 0.01;
const TURNING: f64 = 0.05;

/// A place that the tool goes through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Station {
    pub(super) pose: Isometry3<f64>,
    /// The given pose that it is, by its index among all.
    pub(super) given: Option<usize>,
}

/// The poses of a segment, whose first one has this index among all, with places on the straight way
/// from each to the next.
pub(super) fn stations(segment: &[Isometry3<f64>], first: usize) -> Vec<Station> {
    let mut all: Vec<Station> = Vec::with_capacity(segment.len());
    for (k, pose) in segment.iter().enumerate() {
        if let Some(before) = k.checked_sub(1).map(|b| &segment[b]) {
            let parts = apart(before, pose).ceil().max(1.0);
            let between = (1..parts as usize).map(|i| before.lerp_slerp(pose, i as f64 / parts));
            all.extend(between.map(|pose| Station { pose, given: None }));
        }
        all.push(Station { pose: *pose, given: Some(first + k) });
    }
    all
}

/// How many spacings two poses are apart.
pub(super) fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    let shift = (a.translation.vector - b.translation.vector).norm();
    (shift / SPACING).max(a.rotation.angle_to(&b.rotation) / TURNING)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn places_are_put_in_where_poses_are_far_apart() {
        let far = Isometry3::new(Vector3::x() * 0.035, Vector3::zeros());
        let turned = Isometry3::new(Vector3::x() * 0.035, Vector3::z() * 0.09);
        let all = stations(&[Isometry3::identity(), far, turned], 7);
        let given: Vec<_> = all.iter().map(|s| s.given).collect();
        assert_eq!(given, [Some(7), None, None, None, Some(8), None, Some(9)]);
        assert!(all.windows(2).all(|w| apart(&w[0].pose, &w[1].pose) <= 1.0));
        assert!((all[1].pose.translation.x - 0.00875).abs() < 1e-12);
    }
}
