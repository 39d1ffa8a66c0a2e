//! What is there: the surface to sweep and all that is in the way.

use std::collections::HashSet;

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::{Obstacle, ObstacleShape, Points};
use nullsweep_robot::Geometry;
use nullsweep_surface::{
    CleanConfig, CropBox, Measured, PlacedScan, Scan, ScanError, clean, clean_region, measured,
    unseen,
};

use crate::regions::{RegionError, Regions};

/// The surface to sweep and what is around it, in one frame: the floor frame where it is
/// given.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The scanned surface that is to be swept.
    pub surface: Scan,
    /// Points that were measured but are not of the surface. \[m\]
    pub surroundings: Vec<Point3<f64>>,
    /// The measurements that the surface was made of, noise and all. \[m\]
    pub raw: Vec<Point3<f64>>,
    /// The border of the space that no view has seen. \[m\]
    pub unseen: Vec<Point3<f64>>,
    /// Solid things besides the scan.
    pub obstacles: Vec<Obstacle>,
    /// What of it is to be swept, and how; what is not to be touched or entered.
    pub regions: Regions,
    /// The points of surface and surroundings that the tool keeps out of. \[m\]
    pub keep_out: Vec<Point3<f64>>,
}

/// Side of the cubes of which a sketch keeps one point. \[m\]
const SKETCH: f64 = 0.02;

/// The first point in each cube.
fn thinned(points: &[Point3<f64>], side: f64) -> Vec<Point3<f64>> {
    let mut taken = HashSet::new();
    let cube = |p: &Point3<f64>| [0, 1, 2].map(|i| (p[i] / side).floor() as i64);
    points.iter().filter(|p| taken.insert(cube(p))).copied().collect()
}

/// Points of a box that are no farther apart than `step` \[m\]; none of another shape.
fn box_points(obstacle: &Obstacle, step: f64) -> Vec<Point3<f64>> {
    let ObstacleShape::Geometry(Geometry::Box { half_extents: half }) = &obstacle.shape else {
        return Vec::new();
    };
    let steps = half.map(|h| (2.0 * h / step).ceil().max(1.0) as usize);
    let at = |i: usize, n: usize| -half[i] + 2.0 * half[i] * n as f64 / steps[i] as f64;
    let mut points = Vec::new();
    for x in 0..=steps.x {
        for y in 0..=steps.y {
            for z in 0..=steps.z {
                points.push(obstacle.pose * Point3::new(at(0, x), at(1, y), at(2, z)));
            }
        }
    }
    points
}

impl Scene {
    /// A surface that stands on the floor, nothing else around it.
    #[must_use]
    pub fn on_floor(surface: Scan) -> Self {
        Self { surface, ..Self::empty() }
    }

    /// The floor.
    #[must_use]
    pub fn empty() -> Self {
        Self::of_obstacles(vec![Obstacle::floor(Isometry3::identity())])
    }

    /// Nothing scanned, only solid things.
    #[must_use]
    pub fn of_obstacles(obstacles: Vec<Obstacle>) -> Self {
        let (points, normals, raw) = (Vec::new(), Vec::new(), Vec::new());
        let surface = Scan { points, normals, raw, spacing: 0.0 };
        let (surroundings, raw, unseen) = (Vec::new(), Vec::new(), Vec::new());
        let (regions, keep_out) = (Regions::default(), Vec::new());
        Self { surface, surroundings, raw, unseen, obstacles, regions, keep_out }
    }

    /// The scene with regions in its frame, those to avoid as solid things.
    ///
    /// # Errors
    /// A region matches nothing: see [`Regions::check`].
    pub fn with_regions(mut self, regions: Regions) -> Result<Self, RegionError> {
        regions.check(&self.surface.points, &self.surroundings)?;
        self.obstacles.extend(regions.solids());
        self.keep_out = regions.keep_out(self.surface.points.iter().chain(&self.surroundings));
        Ok(Self { regions, ..self })
    }

    /// What placed views show, on the floor: the surface in a region, or all of it, and everything
    /// else that was measured or hidden. Second, the flying pixels, which are taken for nothing.
    ///
    /// # Errors
    /// No surface: see [`clean()`] and [`clean_region()`].
    pub fn seen(
        scan: &PlacedScan,
        region: Option<&CropBox>,
        config: &CleanConfig,
    ) -> Result<(Self, Vec<Point3<f64>>), ScanError> {
        let (surface, _) = match region {
            None => clean(scan, config)?,
            Some(region) => clean_region(scan, region, config)?,
        };
        Ok(Self::around(surface, scan))
    }

    /// A surface that was made of a part of placed views, on the floor, and everything else that
    /// they show or hide. Second, the flying pixels, which are taken for nothing.
    #[must_use]
    pub fn around(surface: Scan, scan: &PlacedScan) -> (Self, Vec<Point3<f64>>) {
        let Measured { raw, rest, flying } = measured(scan, &surface);
        let unseen = unseen::border(scan, &surface, unseen::DEEPEST);
        (Self { surroundings: rest, raw, unseen, ..Self::on_floor(surface) }, flying)
    }

    /// The scene with nothing to sweep: all that was measured is in the way.
    #[must_use]
    pub fn in_the_way(self) -> Self {
        let Self { surface, mut surroundings, raw, unseen, obstacles, regions, keep_out } = self;
        surroundings.extend(surface.points);
        surroundings.extend(raw);
        Self { surroundings, unseen, regions, keep_out, ..Self::of_obstacles(obstacles) }
    }

    /// The scene with fewer points around the surface, to judge many stances by.
    #[must_use]
    pub fn sketch(&self) -> Self {
        let surroundings = thinned(&self.surroundings, SKETCH);
        let unseen = thinned(&self.unseen, SKETCH);
        Self { surroundings, raw: Vec::new(), unseen, ..self.clone() }
    }

    /// A point in each cube of a side \[m\] that holds something: what was measured, what no view has
    /// seen, and boxes that the robot does not stand on.
    #[must_use]
    pub fn outline(&self, side: f64) -> Vec<Point3<f64>> {
        let boxes =
            self.obstacles.iter().filter(|o| !o.carries_robot).flat_map(|o| box_points(o, side));
        let lists = [&self.surface.points, &self.surroundings, &self.unseen];
        let all: Vec<_> = lists.into_iter().flatten().copied().chain(boxes).collect();
        thinned(&all, side)
    }

    /// The scene as far as a distance \[m\] from a place on the floor, all heights, solid things as they
    /// are; second, which points of the surface that leaves, as indices. All of them in a scene no
    /// larger than that.
    #[must_use]
    pub fn near(&self, place: [f64; 2], distance: f64) -> (Self, Vec<u32>) {
        let [x, y] = place;
        let is_near = |p: &Point3<f64>| libm::hypot(p.x - x, p.y - y) <= distance;
        let some = |points: &[Point3<f64>]| points.iter().copied().filter(is_near).collect();
        let kept: Vec<u32> = (0..self.surface.points.len() as u32)
            .filter(|&i| is_near(&self.surface.points[i as usize]))
            .collect();
        let scene = Self {
            surface: self.surface.of(&kept),
            surroundings: some(&self.surroundings),
            raw: some(&self.raw),
            unseen: some(&self.unseen),
            obstacles: self.obstacles.clone(),
            regions: self.regions.clone(),
            keep_out: some(&self.keep_out),
        };
        (scene, kept)
    }

    /// The scene seen from another frame: everything moved by `pose`.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        let moved = |o: &Obstacle| Obstacle { pose: pose * o.pose, ..o.clone() };
        let all = |points: &[Point3<f64>]| points.iter().map(|p| pose * p).collect();
        Self {
            surface: self.surface.transformed(pose),
            surroundings: all(&self.surroundings),
            raw: all(&self.raw),
            unseen: all(&self.unseen),
            obstacles: self.obstacles.iter().map(moved).collect(),
            regions: self.regions.transformed(pose),
            keep_out: all(&self.keep_out),
        }
    }

    /// All points of it, as the collision checks take them.
    #[must_use]
    pub fn points(&self) -> Points<'_> {
        let Self { surface, surroundings, raw, unseen, keep_out, .. } = self;
        Points { surface: &surface.points, surroundings, raw, unseen, keep_out }
    }
}
