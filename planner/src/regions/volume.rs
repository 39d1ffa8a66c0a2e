//! Volumes: which points they hold, how far others are from them, and what solid they are.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use nullsweep_collision::{Obstacle, ObstacleShape};
use nullsweep_robot::Geometry;

use super::marked::Marked;

/// A shape where it stands.
#[derive(Clone, Debug)]
pub struct Volume {
    /// The shape in its own frame.
    pub shape: Shape,
    /// Where that frame is. \[m\]
    pub pose: Isometry3<f64>,
}

/// A shape in its own frame. \[m\]
#[derive(Clone, Debug)]
pub enum Shape {
    /// A box about the origin.
    Box {
        /// Half of its sides.
        half: Vector3<f64>,
    },
    /// A sphere about the origin.
    Sphere {
        /// Its radius.
        radius: f64,
    },
    /// All that stands over a polygon of the plane z = 0.
    Prism {
        /// The polygon, either way round.
        outline: Vec<[f64; 2]>,
        /// From which z.
        low: f64,
        /// To which z.
        high: f64,
    },
    /// All of z ≥ 0.
    HalfSpace,
    /// What was measured and marked.
    Marked(Arc<Marked>),
}

impl Volume {
    /// Whether it holds a point.
    #[must_use]
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        let own = self.pose.inverse_transform_point(p);
        match &self.shape {
            Shape::Marked(marked) => marked.contains(&own),
            _ => self.distance(p) <= 0.0,
        }
    }

    /// How far a point is outside of it; 0 inside. \[m\]
    #[must_use]
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        let own = self.pose.inverse_transform_point(p);
        match &self.shape {
            Shape::Box { half } => (own.coords.abs() - half).map(|over| over.max(0.0)).norm(),
            Shape::Sphere { radius } => (own.coords.norm() - radius).max(0.0),
            Shape::Prism { outline, low, high } => {
                let beside = from_polygon(outline, own.x, own.y);
                libm::hypot(beside, (low - own.z).max(own.z - high).max(0.0))
            }
            Shape::HalfSpace => (-own.z).max(0.0),
            Shape::Marked(marked) => marked.distance(&own),
        }
    }

    /// The same, seen from another frame.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        Self { shape: self.shape.clone(), pose: pose * self.pose }
    }

    /// It as a solid thing; none of what was measured, which is in the way by itself.
    pub(super) fn obstacle(&self, name: &str) -> Option<Obstacle> {
        let mut pose = self.pose;
        let shape = match &self.shape {
            Shape::Box { half } => Geometry::Box { half_extents: *half }.into(),
            Shape::Sphere { radius } => Geometry::Sphere { radius: *radius }.into(),
            Shape::Prism { outline, low, high } => {
                ObstacleShape::Hulls(hulls(outline, *low, *high))
            }
            Shape::HalfSpace => {
                pose *= nalgebra::UnitQuaternion::from_axis_angle(
                    &Vector3::x_axis(),
                    std::f64::consts::PI,
                );
                ObstacleShape::Floor
            }
            Shape::Marked(_) => return None,
        };
        Some(Obstacle { name: name.to_owned(), shape, pose, carries_robot: false })
    }
}

/// The sides of a polygon.
fn sides(outline: &[[f64; 2]]) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).map(|(a, b)| (Vector2::from(*a), Vector2::from(*b)))
}

/// How far a place of the plane is outside of a polygon; 0 inside. \[m\]
fn from_polygon(outline: &[[f64; 2]], x: f64, y: f64) -> f64 {
    let p = Vector2::new(x, y);
    // A ray along x crosses the outline an odd number of times from inside.
    let crosses = |(a, b): &(Vector2<f64>, Vector2<f64>)| {
        (a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x
    };
    if sides(outline).filter(crosses).count() % 2 == 1 {
        return 0.0;
    }
    let from_side = |(a, b): (Vector2<f64>, Vector2<f64>)| {
        let along = b - a;
        let length = along.norm_squared();
        let share = if length > 0.0 { ((p - a).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
        (p - a - along * share).norm()
    };
    sides(outline).map(from_side).fold(f64::INFINITY, f64::min)
}

/// The polygon's area. \[m²\]
pub(super) fn area(outline: &[[f64; 2]]) -> f64 {
    0.5 * sides(outline).map(|(a, b)| a.perp(&b)).sum::<f64>().abs()
}

/// The triangles of a polygon, by the indices of their corners.
fn triangles(outline: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut corners: Vec<u32> = Vec::new();
    earcut::Earcut::new().earcut(outline.iter().copied(), &[], &mut corners);
    corners.chunks_exact(3).map(|three| [three[0], three[1], three[2]]).collect()
}

/// The corners of a triangle's prism, for each triangle of a polygon that is no mere line.
fn hulls(outline: &[[f64; 2]], low: f64, high: f64) -> Vec<Vec<Point3<f64>>> {
    let of = |corners: [u32; 3]| {
        let flat = corners.map(|c| outline[c as usize]);
        (area(&flat) > 1e-12).then(|| {
            let at = |z: f64| flat.map(|[x, y]| Point3::new(x, y, z));
            [at(low), at(high)].concat()
        })
    };
    triangles(outline).into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(shape: Shape) -> Volume {
        Volume { shape, pose: Isometry3::new(Vector3::new(1.0, 2.0, 0.5), Vector3::z() * 0.3) }
    }

    /// An L, which is not convex.
    fn corner() -> Shape {
        let outline = vec![[0.0, 0.0], [0.4, 0.0], [0.4, 0.1], [0.1, 0.1], [0.1, 0.3], [0.0, 0.3]];
        Shape::Prism { outline, low: -0.1, high: 0.2 }
    }

    #[test]
    fn a_volume_holds_what_is_in_it_and_measures_what_is_not() {
        let half = Vector3::new(0.1, 0.2, 0.3);
        for (shape, inside, outside, apart) in [
            (Shape::Box { half }, [0.1, -0.2, 0.3], [0.4, 0.6, 0.3], 0.5),
            (Shape::Sphere { radius: 0.2 }, [0.0, 0.2, 0.0], [0.0, 0.0, 0.5], 0.3),
            (corner(), [0.05, 0.29, 0.1], [0.4, 0.2, 0.1], 0.1),
            (corner(), [0.39, 0.05, -0.1], [0.2, 0.05, 0.3], 0.1),
            (corner(), [0.05, 0.05, 0.0], [0.2, 0.15, 0.0], 0.05),
            (Shape::HalfSpace, [9.0, 9.0, 0.0], [3.0, 0.0, -0.2], 0.2),
        ] {
            let volume = at(shape);
            let there = |p: [f64; 3]| volume.pose * Point3::from(p);
            assert!(volume.contains(&there(inside.map(|x| 0.999 * x))), "{volume:?}");
            assert!(!volume.contains(&there(outside)), "{volume:?}");
            assert!((volume.distance(&there(outside)) - apart).abs() < 1e-9, "{volume:?}");
            let moved = volume.transformed(&Isometry3::translation(5.0, 0.0, 0.0));
            assert!(!moved.contains(&(there(outside) + Vector3::x() * 5.0)));
            assert!((moved.distance(&(there(outside) + Vector3::x() * 5.0)) - apart).abs() < 1e-9);
        }
    }

    #[test]
    fn a_prism_that_is_not_convex_is_cut_into_pieces_of_its_volume() {
        let Shape::Prism { outline, low, high } = corner() else { panic!("a prism") };
        let pieces = hulls(&outline, low, high);
        let flat = |piece: &Vec<Point3<f64>>| [0, 1, 2].map(|i| [piece[i].x, piece[i].y]);
        let all: f64 = pieces.iter().map(|piece| area(&flat(piece))).sum();
        assert!((all - area(&outline)).abs() < 1e-12 && (all - 0.06).abs() < 1e-12, "{all}");
        let notch = Point3::new(0.25, 0.2, 0.0);
        let in_piece =
            |piece: &Vec<Point3<f64>>| from_polygon(&flat(piece), notch.x, notch.y) <= 0.0;
        assert!(!pieces.iter().any(in_piece), "the notch is free");
    }

    #[test]
    fn a_point_belongs_to_the_measured_one_that_is_nearest() {
        let points: Vec<Point3<f64>> =
            (0..20).map(|i| Point3::new(0.005 * f64::from(i), 0.0, 0.0)).collect();
        let marked = points.iter().map(|p| p.x < 0.05).collect();
        let volume = at(Shape::Marked(Arc::new(Marked::new(points, marked))));
        let there = |x: f64, z: f64| volume.pose * Point3::new(x, 0.0, z);
        assert!(volume.contains(&there(0.046, 0.004)));
        assert!(!volume.contains(&there(0.049, 0.004)), "the next one is nearer");
        assert!(!volume.contains(&there(0.02, 0.02)), "nothing was measured there");
        assert!((volume.distance(&there(0.02, 0.02)) - 0.02).abs() < 1e-9);
        assert!(volume.obstacle("paint").is_none());
    }
}
