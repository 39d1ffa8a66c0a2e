//! A tree of spheres that covers a solid: the coarse ones prove most of it far from everything.

use nalgebra::Vector3;

use crate::frame::Frame;
use crate::solid::Solid;

/// One sphere of a tree in preorder. \[m\]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sphere {
    pub(crate) centre: Vector3<f64>,
    pub(crate) radius: f64,
    /// Index of the first sphere after this one's subtree; the next index for a leaf.
    pub(crate) skip: u32,
}

/// Spheres in preorder: each inner sphere's solid part is covered by the spheres of its subtree.
#[derive(Clone, Debug, Default)]
pub(crate) struct SphereTree {
    pub(crate) spheres: Vec<Sphere>,
}

/// Largest width of a leaf: about what the distance grid can tell apart, and small enough that few
/// scan points have to be looked at for each. \[m\]
const LEAF: f64 = 0.05;

impl SphereTree {
    /// Covers the solid (no half-space) standing at `pose`; centres come in the parent's frame.
    pub(crate) fn new(solid: &Solid, pose: &Frame) -> Self {
        let (min, max) = solid.bounds();
        let mut tree = Self::default();
        tree.cover(solid, min, max, solid.bounding_radius());
        for sphere in &mut tree.spheres {
            sphere.centre = pose.apply(&sphere.centre);
        }
        tree
    }

    /// Visits the spheres from the root: `proven` prunes a subtree, `leaf` decides where no sphere
    /// could. False as soon as a leaf is false.
    #[inline]
    pub(crate) fn all(
        &self,
        mut proven: impl FnMut(&Sphere) -> bool,
        mut leaf: impl FnMut(&Sphere) -> bool,
    ) -> bool {
        let mut i = 0;
        while i < self.spheres.len() {
            let sphere = &self.spheres[i];
            if proven(sphere) {
                i = sphere.skip as usize;
            } else if sphere.skip as usize == i + 1 {
                if !leaf(sphere) {
                    return false;
                }
                i += 1;
            } else {
                i += 1;
            }
        }
        true
    }

    /// Adds another cover beside this one.
    pub(crate) fn append(&mut self, other: &Self) {
        let offset = self.spheres.len() as u32;
        let shifted = other.spheres.iter().map(|s| Sphere { skip: s.skip + offset, ..*s });
        self.spheres.extend(shifted);
    }

    /// The sphere about everything.
    pub(crate) fn root(&self) -> &Sphere {
        &self.spheres[0]
    }

    /// Upper bound of the distance of any covered point from the line through the origin of the
    /// parent's frame along the unit vector `axis`. \[m\]
    pub(crate) fn reach_from_axis(&self, axis: &Vector3<f64>) -> f64 {
        let beside = |c: &Vector3<f64>| (c - axis * axis.dot(c)).norm();
        self.leaves().map(|s| beside(&s.centre) + s.radius).fold(0.0, f64::max)
    }

    /// Upper bound of the distance of any covered point from `origin`, in the parent's frame. \[m\]
    pub(crate) fn reach_from(&self, origin: &Vector3<f64>) -> f64 {
        self.leaves().map(|s| (s.centre - origin).norm() + s.radius).fold(0.0, f64::max)
    }

    fn leaves(&self) -> impl Iterator<Item = &Sphere> {
        self.spheres.iter().enumerate().filter(|(i, s)| s.skip as usize == i + 1).map(|(_, s)| s)
    }

    /// Appends the subtree for the part of the solid within one box; nothing if that is empty.
    fn cover(&mut self, solid: &Solid, min: Vector3<f64>, max: Vector3<f64>, most: f64) {
        let (centre, half) = (0.5 * (min + max), 0.5 * (max - min));
        let radius = half.norm();
        if solid.distance_bound(&centre) > radius {
            return;
        }
        let at = self.spheres.len();
        self.spheres.push(Sphere { centre, radius: radius.min(most) + 1e-9, skip: 0 });
        let axis = half.imax();
        if 2.0 * half[axis] > LEAF {
            let (mut left_max, mut right_min) = (max, min);
            left_max[axis] = centre[axis];
            right_min[axis] = centre[axis];
            self.cover(solid, min, left_max, f64::INFINITY);
            self.cover(solid, right_min, max, f64::INFINITY);
        }
        // A box whose halves both turned out to be empty stays as a leaf: still a valid cover.
        self.spheres[at].skip = self.spheres.len() as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaves_cover_the_solid_and_inner_spheres_their_solid_part() {
        let solid = Solid::Cylinder { half: 0.2, radius: 0.07 };
        let tree = SphereTree::new(&solid, &Frame::IDENTITY);
        let mut inside = 0;
        for n in 0..20_000 {
            // A low-discrepancy sequence over the bounds.
            let f = |a: f64| ((f64::from(n) * a).fract() - 0.5) * 2.0;
            let p = Vector3::new(0.07 * f(0.819_173), 0.2 * f(0.671_043), 0.07 * f(0.549_700));
            if solid.distance_bound(&p) > 0.0 {
                continue;
            }
            inside += 1;
            assert!(tree.leaves().any(|s| (s.centre - p).norm() <= s.radius), "{p} uncovered");
            assert!((tree.root().centre - p).norm() <= tree.root().radius);
        }
        assert!(inside > 10_000);
    }
}
