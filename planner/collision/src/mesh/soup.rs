//! Triangles without any order, as an STL file holds them, and how they are cut by a plane.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

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

    /// With all its openings closed, so that each edge is of an even number of triangles: a fan closes
    /// each border, from the middle of that border's vertices. What it encloses then is its inside.
    pub(crate) fn closed(mut self) -> Self {
        let mut edges: Vec<[usize; 2]> = self
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .filter(|[a, b]| a != b)
            .collect();
        edges.sort_unstable();
        let is_odd = |edge: &&[[usize; 2]]| edge.len() % 2 == 1;
        let border: Vec<[usize; 2]> =
            edges.chunk_by(|a, b| a == b).filter(is_odd).map(|edge| edge[0]).collect();
        for edges in connected(&border) {
            let sum: Vector3<f64> =
                edges.iter().flatten().map(|&corner| self.vertices[corner].coords).sum();
            let middle = self.vertices.len();
            self.vertices.push(Point3::from(sum / (2 * edges.len()) as f64));
            self.triangles.extend(edges.iter().map(|[a, b]| [*a, *b, middle]));
        }
        self
    }

    /// What is on the low and on the high side of the plane across an axis: triangles that it goes
    /// through are cut. A closed mesh's halves are closed again, in the plane.
    pub(crate) fn cut(&self, axis: usize, at: f64) -> [Self; 2] {
        let side = |sign: f64| {
            let mut kept = Vec::new();
            for corners in self.corners() {
                let clipped = clip(&corners, axis, at, sign);
                for i in 2..clipped.len() {
                    kept.extend([clipped[0], clipped[i - 1], clipped[i]]);
                }
            }
            Self::of(kept).closed()
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

/// Edges by how they hang together.
fn connected(edges: &[[usize; 2]]) -> Vec<Vec<[usize; 2]>> {
    let mut at: HashMap<usize, Vec<usize>> = HashMap::new();
    for (i, edge) in edges.iter().enumerate() {
        edge.iter().for_each(|&corner| at.entry(corner).or_default().push(i));
    }
    let mut is_taken = vec![false; edges.len()];
    let mut groups = Vec::new();
    for first in 0..edges.len() {
        if std::mem::replace(&mut is_taken[first], true) {
            continue;
        }
        let mut group = vec![edges[first]];
        let mut next = 0;
        while let Some(&edge) = group.get(next) {
            next += 1;
            for &other in edge.iter().flat_map(|corner| &at[corner]) {
                if !std::mem::replace(&mut is_taken[other], true) {
                    group.push(edges[other]);
                }
            }
        }
        groups.push(group);
    }
    groups
}

/// Where the line between two points meets the plane across an axis: the same for both triangles at
/// an edge, to the bit.
fn crossing(p: &Point3<f64>, q: &Point3<f64>, axis: usize, at: f64) -> Point3<f64> {
    let order = |i: usize| p[i].total_cmp(&q[i]);
    let is_first = order(0).then(order(1)).then(order(2)).is_lt();
    let (p, q) = if is_first { (p, q) } else { (q, p) };
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
