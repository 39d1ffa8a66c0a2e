//! Strips side by side over the surface: a raster.
//!
//! The patches that are to be visited are gathered into faces, pieces that bend little. Over each
//! face go straight strips at one angle, the pad across them and as far apart as it is long but for
//! some overlap, and along each strip places for it. The order of the strips, and which way each is
//! gone along, is a generalised travelling salesman with two nodes a strip.

use std::f64::consts::PI;

use nalgebra::{Point3, UnitVector3, Vector3};
use nullsweep_gtsp::{self as gtsp, Budget, Costs, Ends, Instance, Jump};
use nullsweep_robot::Tool;
use nullsweep_surface::{Patch, Scan, SurfacePoint};

use super::formulation::FormulationError;
use crate::workcell::{Bed, heading_of, tangents};

/// The greatest angle between a patch's normal and its face's. \[rad\]
const BENT: f64 = 0.6;
/// Farthest between two places of a strip, \[m\] and of a tool that works from afar as a share of what
/// it works on along the travel.
const SPACING: f64 = 0.045;
const SPACING_SHARE: f64 = 0.5;
/// A gap that is longer than this cuts a strip, as a share of the pad's width.
const GAP: f64 = 1.0;
/// Farthest from a point of the face, seen along its normal, that the surface is looked for. \[m\]
const NEAR: f64 = 0.03;
/// A strip that is shorter than this is one place. \[m\]
const SHORT: f64 = 0.01;
/// Half of the length of strip over which normals are averaged. \[m\]
const WAVE: f64 = 0.12;
/// What turning from one strip into the next costs, as a length. \[m\]
const TURN: f64 = 0.25;
/// Angles that are compared, evenly over half a turn.
const ANGLES: usize = 12;

/// A place of the pad on a strip.
#[derive(Clone, Debug)]
pub struct Place {
    /// Where, and the points of its face that the pad covers there.
    pub patch: Patch,
    /// The pad's heading, along the strip. \[rad\]
    pub heading: f64,
}

/// A piece of the surface that bends little.
#[derive(Clone, Debug)]
pub struct Face {
    centre: Point3<f64>,
    normal: UnitVector3<f64>,
    /// Indices into the scan, ascending.
    points: Vec<u32>,
}

impl Face {
    /// The faces of the patches that are marked, neighbours in them no farther than `neighbour` \[m\].
    #[must_use]
    pub fn all(scan: &Scan, patches: &[Patch], marked: &[bool], neighbour: f64) -> Vec<Self> {
        let mut open: Vec<bool> = marked.to_vec();
        let alike = |a: &UnitVector3<f64>, b: &UnitVector3<f64>| a.dot(b) >= libm::cos(BENT);
        let near = |a: &Patch, b: &Patch| (a.centre - b.centre).norm() <= neighbour;
        let mut faces = Vec::new();
        loop {
            // Where most patches lie alike there is the middle of a face.
            let around = |&i: &usize| {
                let others = (0..patches.len()).filter(|&k| open[k]);
                others
                    .filter(|&k| {
                        let apart = (patches[k].centre - patches[i].centre).norm();
                        apart <= 2.0 * neighbour
                            && patches[k].normal.dot(&patches[i].normal) >= libm::cos(0.5 * BENT)
                    })
                    .count()
            };
            let seeds = (0..patches.len()).filter(|&i| open[i]);
            let Some(seed) = seeds.max_by_key(|i| (around(i), std::cmp::Reverse(*i))) else {
                return faces;
            };
            open[seed] = false;
            let (mut members, mut next) = (vec![seed], 0);
            let mut normal = patches[seed].normal;
            while let Some(&here) = members.get(next) {
                next += 1;
                for other in 0..patches.len() {
                    let joins = open[other]
                        && near(&patches[here], &patches[other])
                        && alike(&normal, &patches[other].normal);
                    if joins {
                        open[other] = false;
                        members.push(other);
                        let sum = members.iter().fold(Vector3::zeros(), |sum, &m| {
                            sum + patches[m].normal.scale(patches[m].points.len() as f64)
                        });
                        normal = UnitVector3::new_normalize(sum);
                    }
                }
            }
            let mut points: Vec<u32> =
                members.iter().flat_map(|&m| patches[m].points.iter().copied()).collect();
            points.sort_unstable();
            points.dedup();
            let sum = points
                .iter()
                .fold(Vector3::zeros(), |sum, &i| sum + scan.points[i as usize].coords);
            let centre = Point3::from(sum / points.len().max(1) as f64);
            faces.push(Self { centre, normal, points });
        }
    }

    /// Strips at the angles that are compared, those first that are likely to take the least time.
    #[must_use]
    pub fn rasters(&self, scan: &Scan, bed: &Bed, tool: &Tool) -> Vec<Vec<Vec<Place>>> {
        let mut rasters: Vec<Vec<Vec<Place>>> = (0..ANGLES)
            .map(|k| self.strips(scan, bed, tool, PI * k as f64 / ANGLES as f64))
            .filter(|strips| !strips.is_empty())
            .collect();
        let length = |strips: &Vec<Vec<Place>>| -> f64 {
            let of = |strip: &Vec<Place>| -> f64 {
                strip.windows(2).map(|w| (w[1].patch.centre - w[0].patch.centre).norm()).sum()
            };
            strips.iter().map(|strip| of(strip) + TURN).sum()
        };
        rasters.sort_by(|a, b| length(a).total_cmp(&length(b)));
        rasters
    }

    /// Strips at an angle from the first of the tangents of its normal. \[rad\]
    #[must_use]
    pub fn strips(&self, scan: &Scan, bed: &Bed, tool: &Tool, angle: f64) -> Vec<Vec<Place>> {
        let (e1, e2) = tangents(&self.normal);
        let along = e1 * libm::cos(angle) + e2 * libm::sin(angle);
        let across = self.normal.cross(&along);
        let flat: Vec<Flat> = self
            .points
            .iter()
            .map(|&index| {
                let point = scan.points[index as usize];
                let off = point - self.centre;
                Flat { index, point, u: off.dot(&along), v: off.dot(&across) }
            })
            .collect();
        let (low, high) = extent(flat.iter().map(|p| p.v));
        let count = ((high - low) / tool.pitch()).ceil().max(1.0);
        let [_, length] = tool.track();
        let spacing = if tool.touches() { SPACING } else { SPACING.max(SPACING_SHARE * length) };
        let band = (high - low) / count;
        let mut strips = Vec::new();
        for k in 0..count as usize {
            let middle = low + (k as f64 + 0.5) * band;
            let within = flat.iter().filter(|p| (p.v - middle).abs() <= 0.5 * band);
            let mut us: Vec<f64> = within.map(|p| p.u).collect();
            us.sort_by(f64::total_cmp);
            for run in us.chunk_by(|a, b| b - a <= GAP * length) {
                let (from, to) = (run[0], run[run.len() - 1]);
                let inset = tool.strip_inset().min(0.5 * (to - from));
                let (from, to) = (from + inset, to - inset);
                let pieces = ((to - from) / spacing).ceil().max(1.0);
                let stations = if to - from < SHORT { 0 } else { pieces as usize };
                let at = |s: usize| {
                    let share = if stations == 0 { 0.5 } else { s as f64 / stations as f64 };
                    [from + share * (to - from), middle]
                };
                let feet: Vec<Option<SurfacePoint>> = (0..=stations)
                    .map(|s| self.foot(&flat, at(s), [&along, &across], bed))
                    .collect();
                let mut strip = Vec::new();
                for s in 0..=stations {
                    let place = feet[s].and_then(|foot| {
                        let normal = mean_normal(&feet, s)?;
                        self.place(&flat, at(s), SurfacePoint { normal, ..foot }, &along, bed, tool)
                    });
                    match place {
                        Some(place) => strip.push(place),
                        None if !strip.is_empty() => strips.push(std::mem::take(&mut strip)),
                        None => {}
                    }
                }
                if !strip.is_empty() {
                    strips.push(strip);
                }
            }
        }
        strips
    }

    /// The surface under a place of the face's plane.
    fn foot(
        &self,
        flat: &[Flat],
        [u, v]: [f64; 2],
        [along, across]: [&Vector3<f64>; 2],
        bed: &Bed,
    ) -> Option<SurfacePoint> {
        let apart = |p: &&Flat| libm::hypot(p.u - u, p.v - v);
        let nearest = flat.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
        if apart(&nearest) > NEAR {
            return None;
        }
        let over = nearest.point + along * (u - nearest.u) + across * (v - nearest.v);
        bed.surface().project(&over, &self.normal)
    }

    /// The pad laid down on the surface under a place of the face's plane.
    fn place(
        &self,
        flat: &[Flat],
        [u, v]: [f64; 2],
        foot: SurfacePoint,
        along: &Vector3<f64>,
        bed: &Bed,
        tool: &Tool,
    ) -> Option<Place> {
        let beside = |p: &&Flat| tool.is_under(p.u - u, p.v - v);
        let points: Vec<u32> = flat.iter().filter(beside).map(|p| p.index).collect();
        let patch = Patch { centre: foot.point, normal: foot.normal, points, rmse: 0.0 };
        let patch = bed.laid(patch)?;
        let heading = heading_of(&patch.normal, along);
        Some(Place { patch, heading })
    }
}

/// The normal at a place of a strip, averaged along it as far as it is not cut: a pad that follows each
/// rounded border turns more than it sweeps.
fn mean_normal(feet: &[Option<SurfacePoint>], at: usize) -> Option<UnitVector3<f64>> {
    let here = feet[at]?.point;
    let mut sum = Vector3::zeros();
    let mut add = |foot: &SurfacePoint| {
        let apart = (foot.point - here).norm() / WAVE;
        sum += foot.normal.scale((1.0 - apart * apart).max(0.0));
        apart < 1.0
    };
    feet[at..].iter().map_while(|foot| foot.as_ref()).take_while(|foot| add(foot)).count();
    feet[..at].iter().rev().map_while(|foot| foot.as_ref()).take_while(|foot| add(foot)).count();
    UnitVector3::try_new(sum, 1e-6)
}

/// A point seen along a face's normal.
struct Flat {
    index: u32,
    point: Point3<f64>,
    u: f64,
    v: f64,
}

fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
}

/// The order of the strips from a place on, and whether each is gone along backwards: the shortest
/// ways between them, where a way farther than `join` \[m\] counts as `lift` \[m\] more.
///
/// # Errors
/// A cost that is not a number; it does not occur for finite places.
pub fn order(
    strips: &[Vec<&Patch>],
    start: &Point3<f64>,
    [join, lift]: [f64; 2],
    trials: u64,
    seed: u64,
) -> Result<Vec<(usize, bool)>, FormulationError> {
    if strips.is_empty() {
        return Ok(Vec::new());
    }
    let ends: Vec<[Point3<f64>; 2]> = strips
        .iter()
        .flat_map(|s| {
            let (a, b) = (s[0].centre, s[s.len() - 1].centre);
            [[a, b], [b, a]]
        })
        .collect();
    let between = |from: &[Point3<f64>; 2], to: &[Point3<f64>; 2]| {
        let apart = (to[0] - from[1]).norm();
        if apart > join { apart + lift } else { apart }
    };
    let costs = ends.iter().flat_map(|from| ends.iter().map(|to| between(from, to))).collect();
    let first = ends.iter().map(|to| (to[0] - start).norm()).collect();
    let instance = Instance::new(
        &vec![2; strips.len()],
        Costs::Dense(costs),
        Jump::Forbidden,
        Ends::OpenFromCosts(first),
    )?;
    let tour = gtsp::solve(&instance, &Budget::trials(trials * strips.len() as u64), seed)?.tour;
    Ok(tour.clusters.iter().zip(&tour.nodes).map(|(&c, &n)| (c, n == 1)).collect())
}

#[cfg(test)]
mod tests {
    use nullsweep_surface::{PatchConfig, patches};

    use super::*;
    use crate::sweep::coverage;
    use crate::tour::formulation::{Stop, pose};
    use crate::workcell::Scene;

    /// A floor of 40 × 30 cm, a point every 4 mm.
    fn floor() -> Scan {
        let at = |n: i32| 0.004 * f64::from(n);
        let points: Vec<Point3<f64>> =
            (0..7500).map(|i| Point3::new(at(i % 100), at(i / 100), 0.0)).collect();
        let normals = vec![UnitVector3::new_normalize(Vector3::z()); points.len()];
        Scan { raw: points.clone(), points, normals, spacing: 0.004 }
    }

    #[test]
    fn strips_sweep_all_of_a_floor_and_are_gone_along_to_and_fro() {
        let (scan, tool) = (floor(), Tool::default());
        let bed = Bed::new(&Scene::on_floor(scan.clone()), &tool);
        let found = patches::find(&scan, &PatchConfig::default(), 1);
        let faces = Face::all(&scan, &found, &vec![true; found.len()], 0.10);
        assert_eq!(faces.len(), 1);
        let rasters = faces[0].rasters(&scan, &bed, &tool);
        // Four strips of 40 cm are less way than five of 30.
        let strips = &rasters[0];
        assert_eq!(strips.len(), 4);
        let poses: Vec<_> = strips
            .iter()
            .flatten()
            .map(|place| {
                let stop = Stop { patch: 0, heading: place.heading };
                pose(std::slice::from_ref(&place.patch), &tool, &stop)
            })
            .collect();
        let swept = coverage::swept(&scan, &poses, &tool);
        let share = coverage::share(&swept);
        assert!(share > 0.99, "{share}");

        let ends: Vec<Vec<&Patch>> =
            strips.iter().map(|strip| strip.iter().map(|p| &p.patch).collect()).collect();
        let tour = order(&ends, &Point3::new(0.0, 0.0, 0.1), [0.15, 1.0], 100, 1).expect("a tour");
        let mut visited: Vec<usize> = tour.iter().map(|(strip, _)| *strip).collect();
        assert!(tour.windows(2).all(|w| w[0].1 != w[1].1), "to and fro: {tour:?}");
        assert!(visited.windows(2).all(|w| w[0].abs_diff(w[1]) == 1), "side by side: {tour:?}");
        visited.sort_unstable();
        assert_eq!(visited, [0, 1, 2, 3]);
        assert!(order(&[], &Point3::origin(), [0.15, 1.0], 100, 1).expect("none").is_empty());
    }
}
