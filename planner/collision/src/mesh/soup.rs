//! Triangles without any order, as an STL file holds them, and how they are cut by a plane.

use std::collections::HashMap;

use nalgebra::Point3;

/// Triangles by their vertices' indices; in the mesh's frame. \[m\]
#[derive(Clone, Debug, Default)]
pub(crate) struct Soup {
    pub(crate) vertices: Vec<Point3<f64>>,
    pub(crate) triangles: Vec<[usize; 3]>,
}

impl Soup {
    /// Of corners, three a triangle; equal ones become one vertex.
    pub(crate) fn of(corners: impl IntoIterator<Item = Point3<f64>>) -> Self {
        let mut soup = Self::default();
        let mut known = HashMap::new();
        let mut triangle = Vec::with_capacity(3);
        for corner in corners {
            triangle.push(soup.vertex(&mut known, corner));
            if let [a, b, c] = triangle[..] {
                soup.triangles.push([a, b, c]);
                triangle.clear();
            }
        }
        soup
    }

    fn vertex(&mut self, known: &mut HashMap<[u64; 3], usize>, p: Point3<f64>) -> usize {
        // Adding 0 makes one zero of both.
        *known.entry([0, 1, 2].map(|i| (p[i] + 0.0).to_bits())).or_insert_with(|| {
            self.vertices.push(p);
            self.vertices.len() - 1
        })
    }

    /// The corners of its triangles.
    fn corners(&self) -> impl Iterator<Item = [Point3<f64>; 3]> {
        self.triangles.iter().map(|triangle| triangle.map(|i| self.vertices[i]))
    }

    /// What is on the low and on the high side of the plane across an axis: triangles that it goes
    /// through are cut.
    pub(crate) fn cut(&self, axis: usize, at: f64) -> [Self; 2] {
        let side = |sign: f64| {
            let mut kept = Vec::new();
            for corners in self.corners() {
                let clipped = clip(&corners, axis, at, sign);
                for i in 2..clipped.len() {
                    kept.extend([clipped[0], clipped[i - 1], clipped[i]]);
                }
            }
            Self::of(kept)
        };
        [side(1.0), side(-1.0)]
    }

    /// The corners of both sides of such a cut.
    pub(crate) fn cut_corners(&self, axis: usize, at: f64) -> [Vec<Point3<f64>>; 2] {
        let mut sides = [Vec::new(), Vec::new()];
        for p in &self.vertices {
            if p[axis] <= at {
                sides[0].push(*p);
            }
            if p[axis] >= at {
                sides[1].push(*p);
            }
        }
        for [a, b, c] in self.corners() {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                if (p[axis] - at) * (q[axis] - at) < 0.0 {
                    let between = crossing(&p, &q, axis, at);
                    sides.iter_mut().for_each(|side| side.push(between));
                }
            }
        }
        sides
    }
}

/// Where the line from `p` to `q` meets the plane across an axis.
fn crossing(p: &Point3<f64>, q: &Point3<f64>, axis: usize, at: f64) -> Point3<f64> {
    let mut between = p + (q - p) * ((at - p[axis]) / (q[axis] - p[axis]));
    between[axis] = at;
    between
}

/// The part of a triangle with sign · (x − at) ≤ 0 along the axis: a polygon, or nothing.
fn clip(triangle: &[Point3<f64>; 3], axis: usize, at: f64, sign: f64) -> Vec<Point3<f64>> {
    let beyond = |p: &Point3<f64>| sign * (p[axis] - at) > 0.0;
    let mut kept = Vec::with_capacity(4);
    for i in 0..3 {
        let (p, q) = (triangle[i], triangle[(i + 1) % 3]);
        if !beyond(&p) {
            kept.push(p);
        }
        if beyond(&p) != beyond(&q) && p[axis] != at && q[axis] != at {
            kept.push(crossing(&p, &q, axis, at));
        }
    }
    kept
}
