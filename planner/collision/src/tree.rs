//! Which points lie in a box, for the exact check: a tree of boxes over them.

use nalgebra::Point3;

/// Most points of a leaf.
const LEAF: usize = 16;

/// A binary tree of boxes, each cut at the median along its longest side.
pub(crate) struct Tree {
    /// Indices of the points; every node has a range of them.
    order: Vec<u32>,
    /// The root first, a node's nearer child right after it.
    nodes: Vec<Node>,
}

struct Node {
    low: Point3<f64>,
    high: Point3<f64>,
    /// The range of `order`.
    from: usize,
    to: usize,
    /// The other child; none for a leaf.
    other: Option<usize>,
}

impl Tree {
    pub(crate) fn new(points: &[Point3<f64>]) -> Self {
        let mut tree = Self { order: (0..points.len() as u32).collect(), nodes: Vec::new() };
        if !points.is_empty() {
            tree.grow(points, 0, points.len());
        }
        tree
    }

    fn grow(&mut self, points: &[Point3<f64>], from: usize, to: usize) {
        let (mut low, mut high) =
            (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
        for &i in &self.order[from..to] {
            low = low.inf(&points[i as usize]);
            high = high.sup(&points[i as usize]);
        }
        let node = self.nodes.len();
        self.nodes.push(Node { low, high, from, to, other: None });
        if to - from <= LEAF {
            return;
        }
        let axis = (high - low).imax();
        let middle = (to - from) / 2;
        self.order[from..to].select_nth_unstable_by(middle, |&a, &b| {
            points[a as usize][axis].total_cmp(&points[b as usize][axis])
        });
        self.grow(points, from, from + middle);
        self.nodes[node].other = Some(self.nodes.len());
        self.grow(points, from + middle, to);
    }

    /// Calls `visit` with the index of every point in the closed box from `low` to `high`, and of
    /// some others, until it gives a value.
    pub(crate) fn find<T>(
        &self,
        low: &Point3<f64>,
        high: &Point3<f64>,
        mut visit: impl FnMut(usize) -> Option<T>,
    ) -> Option<T> {
        let mut open: Vec<usize> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = open.pop() {
            let node = &self.nodes[index];
            if (0..3).any(|i| node.high[i] < low[i] || high[i] < node.low[i]) {
                continue;
            }
            match node.other {
                Some(other) => open.extend([other, index + 1]),
                None => {
                    for &point in &self.order[node.from..node.to] {
                        if let Some(found) = visit(point as usize) {
                            return Some(found);
                        }
                    }
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn no_point_of_a_box_is_missed() {
        let mut rng = ChaCha8Rng::seed_from_u64(31);
        let mut draw =
            || Point3::from(std::array::from_fn::<f64, 3, _>(|_| rng.random_range(0.0..1.0)));
        // Points that fall together among them.
        let mut points: Vec<_> = (0..2000).map(|_| draw()).collect();
        points.extend([Point3::origin(); 40]);
        let tree = Tree::new(&points);
        let mut seen = 0;
        for round in 0..200 {
            let corner = draw();
            let low = if round % 10 == 0 { Point3::origin() } else { corner };
            let high = low + Vector3::repeat(0.2);
            let inside = |p: &Point3<f64>| (0..3).all(|i| low[i] <= p[i] && p[i] <= high[i]);
            let mut found = Vec::new();
            let none = tree.find(&low, &high, |i| {
                found.push(i);
                None::<()>
            });
            assert!(none.is_none());
            found.retain(|&i| inside(&points[i]));
            found.sort_unstable();
            let wanted: Vec<usize> = (0..points.len()).filter(|&i| inside(&points[i])).collect();
            assert_eq!(found, wanted);
            seen += wanted.len();
        }
        assert!(seen > 1000, "{seen}");
        assert_eq!(Tree::new(&[]).find(&low_corner(), &low_corner(), Some), None);
    }

    fn low_corner() -> Point3<f64> {
        Point3::origin()
    }
}
