//! The surface between the points of a scan: what tool paths follow and deviations refer to.
//!
//! Two patch centres 5–10 cm apart on a curved body span a chord that runs 4–13 mm inside it.
//! [`Surface::line`] lays that chord onto the surface. The surface is a moving least squares fit
//! whose weights fade out smoothly, so that points and normals along a line vary smoothly: the point
//! set surface of Alexa et al. (2003, see `fit`), with neighbours on the back of a thin wall left out
//! by their normals.

use std::f64::consts::PI;

use nalgebra::{Point3, UnitVector3, Vector3};
use nullsweep_grid::Cells;

use crate::fit::{HeightFit, PlaneFit, weight};
use crate::grid::Grid;
use crate::scan::Scan;

/// Radius of the fit on smoothed points; at least four spacings are taken, and more where the points
/// are noisy. \[m\]
const FIT_RADIUS: f64 = 0.015;

/// Noise of the points up to which that radius suffices: the slope of a fit is the noise over the
/// radius and the root of the number of points, so the radius grows with the noise's root. \[m\]
const NOISE: f64 = 0.0004;

/// How much it may grow.
const WIDEST: f64 = 1.5;

/// Points at which the noise is measured.
const NOISE_SAMPLES: usize = 100;

/// Radius of the fit on raw points, which still carry the sensor's noise. \[m\]
const RAW_RADIUS: f64 = 0.020;

/// Farthest that a point is projected from. \[m\]
const REACH: f64 = 0.04;

/// Widest hole that still counts as surface, from a point to the nearest of the scan; at least
/// three spacings are taken. \[m\]
const GAP: f64 = 0.010;

/// Rounds of projecting and fitting anew at the foot point.
const ROUNDS: usize = 3;

/// Fewest points that the surface is fitted to. A fit has four terms: of fewer points, hardly any is
/// left to say that it is right, and a pad would be led over a hole.
const FIT_POINTS: usize = 10;

/// Fewest points that a plane is laid through to measure a distance.
const PLANE_POINTS: usize = 6;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Where, in the scan's frame. \[m\]
    pub point: Point3<f64>,
    /// The outward normal there.
    pub normal: UnitVector3<f64>,
}

/// The surface of a scan, ready for projections.
#[derive(Clone, Debug)]
pub struct Surface {
    grid: Grid,
    normals: Vec<UnitVector3<f64>>,
    raw_grid: Grid,
    raw: Vec<Point3<f64>>,
    raw_normals: Vec<UnitVector3<f64>>,
    radius: f64,
    /// Within which [`FIT_POINTS`] have to lie: the radius before noise widened it.
    core: f64,
    raw_radius: f64,
    gap: f64,
    spacing: f64,
}

impl Surface {
    /// The surface of a scan.
    #[must_use]
    pub fn new(scan: &Scan) -> Self {
        let radius = FIT_RADIUS.max(4.0 * scan.spacing);
        let raw_radius = RAW_RADIUS.max(4.0 * scan.spacing);
        // In the cells' order neighbours lie together in memory.
        let (_, order) = Cells::new(&scan.points, radius);
        let points: Vec<_> = order.iter().map(|&i| scan.points[i as usize]).collect();
        let (_, raw_order) = Cells::new(&scan.raw, raw_radius);
        let raw: Vec<_> = raw_order.iter().map(|&i| scan.raw[i as usize]).collect();
        let normals: Vec<_> = order.iter().map(|&i| scan.normals[i as usize]).collect();
        let grid = Grid::new(&points, radius);
        let widening = (noise(&grid, &points, &normals, radius) / NOISE).sqrt();
        let (core, radius) = (radius, radius * widening.clamp(1.0, WIDEST));
        Self {
            grid: Grid::new(&points, radius),
            normals,
            raw_grid: Grid::new(&raw, raw_radius),
            raw_normals: raw_order.iter().map(|&i| scan.normals[i as usize]).collect(),
            raw,
            radius,
            core,
            raw_radius,
            gap: GAP.max(3.0 * scan.spacing),
            spacing: scan.spacing,
        }
    }

    /// The foot of a point's perpendicular on the surface, on the sheet whose normal agrees with
    /// `hint` to within about 60°. `None` farther than 4 cm from the surface or over a hole.
    #[must_use]
    pub fn project(&self, point: &Point3<f64>, hint: &UnitVector3<f64>) -> Option<SurfacePoint> {
        let agrees = |index: u32| self.normals[index as usize].dot(hint) > 0.5;
        let (nearest, _) = self.grid.nearest(point, REACH, agrees)?;
        // The height of the nearest point's tangent plane is a first guess of the foot.
        let mut normal = self.normals[nearest as usize];
        let mut foot = *point;
        self.grid.within(point, REACH, |index, position, _| {
            if index == nearest {
                foot = point + normal.scale((position - point).dot(&normal));
            }
        });
        let mut result = None;
        for _ in 0..ROUNDS {
            let found = self.fit(&foot, &normal, hint)?;
            normal = found.normal;
            foot = point + normal.scale((found.point - point).dot(&normal));
            result = Some(found);
        }
        // The last fit stands at the last foot but one, a vanishing step away.
        result.map(|found| SurfacePoint { point: foot, normal: found.normal })
    }

    /// The line on the surface under the chord from `a` to `b`, at most about `step` apart, both
    /// ends exactly as given. Between them the ends' offsets from the surface fade out linearly, as
    /// the plane of a patch does not quite meet the local surface, and the normals change in waves
    /// no shorter than `wave`: a pad lies on more of the surface than a fit sees. `None` where the
    /// chord leaves the surface or the sheet. Lengths in \[m\].
    #[must_use]
    pub fn line(
        &self,
        a: &SurfacePoint,
        b: &SurfacePoint,
        step: f64,
        wave: f64,
    ) -> Option<Vec<SurfacePoint>> {
        let chord = b.point - a.point;
        let pieces = (chord.norm() / step).ceil().max(1.0) as usize;
        let mut line = Vec::with_capacity(pieces + 1);
        let mut at = Vec::with_capacity(pieces + 1);
        for i in 0..=pieces {
            let t = i as f64 / pieces as f64;
            let hint = blend(&a.normal, &b.normal, t)?;
            line.push(self.project(&(a.point + chord * t), &hint)?);
            at.push(t);
        }
        self.fill(&mut line, &mut at, step)?;

        let start = (a.point - line[0].point, *a.normal - *line[0].normal);
        let last = line[line.len() - 1];
        let end = (b.point - last.point, *b.normal - *last.normal);
        for (found, &t) in line.iter_mut().zip(&at) {
            found.point += start.0 * (1.0 - t) + end.0 * t;
            let normal = *found.normal + start.1 * (1.0 - t) + end.1 * t;
            found.normal = UnitVector3::try_new(normal, 1e-6)?;
        }
        line[0] = *a;
        let last = line.len() - 1;
        line[last] = *b;
        low_pass(&mut line, wave)?;
        Some(line)
    }

    /// The normal of the scan's point nearest to `point`, within 4 cm.
    #[must_use]
    pub fn normal_near(&self, point: &Point3<f64>) -> Option<UnitVector3<f64>> {
        let (nearest, _) = self.grid.nearest(point, REACH, |_| true)?;
        Some(self.normals[nearest as usize])
    }

    /// Distance to the nearest of the scan's points whose normal is as asked for, within 4 cm and within
    /// `reach`. \[m\]
    pub fn distance_to(
        &self,
        point: &Point3<f64>,
        reach: f64,
        is_asked: impl Fn(&UnitVector3<f64>) -> bool,
    ) -> Option<f64> {
        let is_asked = |k: u32| is_asked(&self.normals[k as usize]);
        let (_, squared) = self.grid.nearest(point, reach.min(REACH), is_asked)?;
        Some(squared.sqrt())
    }

    /// Distance from a point to the scanned surface: to the plane through the raw points around
    /// its foot, and beyond their border also along the plane. Infinite farther than 10 cm away.
    /// \[m\]
    #[must_use]
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let Some((nearest, squared)) = self.raw_grid.nearest(point, 0.1, |_| true) else {
            return f64::INFINITY;
        };
        let sheet = self.raw_normals[nearest as usize];
        let foot = point + sheet.scale((self.raw[nearest as usize] - point).dot(&sheet));
        let mut fit = PlaneFit::new(foot);
        let mut count = 0;
        let mut border = f64::INFINITY;
        self.raw_grid.within(&foot, self.raw_radius, |index, neighbour, squared| {
            if self.raw_normals[index as usize].dot(&sheet) > 0.5 {
                count += 1;
                border = border.min(squared);
                fit.add(neighbour, weight(squared / self.raw_radius.powi(2)));
            }
        });
        match fit.solve().filter(|_| count >= PLANE_POINTS) {
            Some(plane) => {
                let height = (point - plane.centroid).dot(&plane.normal);
                // Noise puts the nearest raw point off the plane too; two spacings allow for it.
                let beyond = (border.sqrt() - 2.0 * self.spacing.max(0.002)).max(0.0);
                libm::hypot(height, beyond)
            }
            None => squared.sqrt(),
        }
    }

    /// The surface on the line through `foot` along `normal`.
    fn fit(
        &self,
        foot: &Point3<f64>,
        normal: &UnitVector3<f64>,
        hint: &UnitVector3<f64>,
    ) -> Option<SurfacePoint> {
        let mut fit = HeightFit::new(*foot, normal, self.radius);
        let mut count = 0;
        let mut border = f64::INFINITY;
        let scale = 1.0 / (self.radius * self.radius);
        self.grid.within(foot, self.radius, |index, position, squared| {
            // Fading from 78° to 53°, as a hard bound would make the line jump.
            let agreement = ((self.normals[index as usize].dot(hint) - 0.2) / 0.4).clamp(0.0, 1.0);
            if agreement > 0.0 {
                count += usize::from(squared <= self.core * self.core);
                border = border.min(squared);
                fit.add(position, agreement * weight(squared * scale));
            }
        });
        if count < FIT_POINTS || border > self.gap * self.gap {
            return None;
        }
        let (point, found) = fit.solve()?;
        (found.dot(hint) > 0.0).then_some(SurfacePoint { point, normal: found })
    }

    /// Puts projections of midpoints wherever neighbours of a line lie more than one and a half
    /// steps apart, as they do where the surface falls away under the chord.
    fn fill(&self, line: &mut Vec<SurfacePoint>, at: &mut Vec<f64>, step: f64) -> Option<()> {
        let mut i = 0;
        let mut budget = 4 * line.len();
        while i + 1 < line.len() {
            let (a, b) = (line[i], line[i + 1]);
            if (b.point - a.point).norm() <= 1.5 * step {
                i += 1;
                continue;
            }
            budget = budget.checked_sub(1)?;
            let middle = nalgebra::center(&a.point, &b.point);
            let found = self.project(&middle, &blend(&a.normal, &b.normal, 0.5)?)?;
            line.insert(i + 1, found);
            at.insert(i + 1, 0.5 * (at[i] + at[i + 1]));
        }
        Some(())
    }
}

/// Median distance of points from the surface fitted to their neighbours, as the standard deviation
/// of normal noise, which is 1.48 medians. \[m\]
fn noise(grid: &Grid, points: &[Point3<f64>], normals: &[UnitVector3<f64>], radius: f64) -> f64 {
    let step = (points.len() / NOISE_SAMPLES).max(1);
    let mut off: Vec<f64> = (0..points.len())
        .step_by(step)
        .filter_map(|i| {
            let mut fit = HeightFit::new(points[i], &normals[i], radius);
            let mut count = 0;
            grid.within(&points[i], radius, |index, position, squared| {
                if normals[index as usize].dot(&normals[i]) > 0.5 {
                    count += 1;
                    fit.add(position, weight(squared / (radius * radius)));
                }
            });
            let (foot, _) = fit.solve().filter(|_| count >= FIT_POINTS)?;
            Some((points[i] - foot).norm())
        })
        .collect();
    off.sort_by(f64::total_cmp);
    1.48 * off.get(off.len() / 2).copied().unwrap_or(0.0)
}

/// Low-pass filters the normals between a line's ends: of their deviation from the blend of the
/// ends' normals only sine waves over the length are kept that are at least `shortest` long. An arm
/// would follow every ripple with all its joints. `None` where a normal vanishes.
fn low_pass(line: &mut [SurfacePoint], shortest: f64) -> Option<()> {
    let mut arc = vec![0.0];
    for pair in line.windows(2) {
        arc.push(arc[arc.len() - 1] + (pair[1].point - pair[0].point).norm());
    }
    let (last, length) = (line.len() - 1, arc[arc.len() - 1]);
    let ends = [*line[0].normal, *line[last].normal];
    let straight = |i: usize| ends[0].lerp(&ends[1], arc[i] / length);
    let wave = |m: usize, i: usize| libm::sin(PI * m as f64 * arc[i] / length);
    let off: Vec<Vector3<f64>> = (0..=last).map(|i| *line[i].normal - straight(i)).collect();
    // More waves than half the points are not there to be told apart.
    let count = ((2.0 * length / shortest) as usize).min(last / 2);
    // By the trapezoid rule, with waves and deviations that vanish at both ends.
    let amplitude = |m: usize| -> Vector3<f64> {
        (1..last).map(|i| off[i] * (wave(m, i) * (arc[i + 1] - arc[i - 1]) / length)).sum()
    };
    let kept: Vec<(usize, Vector3<f64>)> = (1..=count).map(|m| (m, amplitude(m))).collect();
    for i in 1..last {
        let waves: Vector3<f64> = kept.iter().map(|(m, a)| a * wave(*m, i)).sum();
        line[i].normal = UnitVector3::try_new(straight(i) + waves, 1e-6)?;
    }
    Some(())
}

/// A direction between two; `None` if they are opposite.
fn blend(a: &UnitVector3<f64>, b: &UnitVector3<f64>, t: f64) -> Option<UnitVector3<f64>> {
    let mixed: Vector3<f64> = a.scale(1.0 - t) + b.scale(t);
    UnitVector3::try_new(mixed, 1e-3)
}
