//! What the pad lies on: the surface, and how far above it the pad has to stay so that nothing
//! presses it in too deep.

use std::f64::consts::TAU;

use nalgebra::{Point3, UnitVector3};
use nullsweep_robot::Tool;
use nullsweep_surface::{Grid, Patch, Surface, SurfacePoint};

use super::contact::tangents;
use super::scene::Scene;

/// The pad is raised until this much is left of what it may be pressed. \[m\]
const SPARE: f64 = 0.0005;
/// Farthest that its centre is raised off the surface, and besides by what it is pressed in: a sponge
/// still touches where it is pressed elsewhere. \[m\]
const HIGHEST: f64 = 0.0045;
/// What rises higher over the pad's plane is no unevenness but another thing, which the pad has to
/// keep away from. \[m\]
const UNEVEN: f64 = 0.025;
/// Tilts of the pad that are tried on a patch. \[rad\]
const TILTS: [f64; 3] = [0.07, 0.14, 0.21];
/// Directions of each.
const TURNS: usize = 8;
/// A point that lies too aslant stays so much farther from the pad's centre than the nearest one: the arm
/// follows the line within 0.1 mm. \[m\]
const GRAZE: f64 = 0.0003;
/// The same of a tool that works from afar, and how much more it is to face the surface than it must: so
/// exactly its axis meets what is on the line between two of the arm's joint vectors. \[m\], \[rad\]
const AFAR: (f64, f64) = (0.005, 0.1);
/// Farthest from the place that a tool that works from afar is led over that the surface is the one that
/// it works on. \[m\]
pub const FACED: f64 = 0.03;
/// Least step along a line where such a point is near. \[m\]
const CREEP: f64 = 0.0001;
/// The pad is raised and let down no more steeply than this along its way.
const STEEPEST: f64 = 0.25;

/// The surface, and the points that press on a pad that lies on it; in one frame.
pub struct Bed {
    surface: Surface,
    points: Vec<Point3<f64>>,
    grid: Grid,
    /// Radius of the disc around the pad's centre that is looked at: half its long side. \[m\]
    radius: f64,
    /// How deep a point may press, and how far the pad may be raised for it. \[m\]
    deepest: f64,
    highest: f64,
    /// Cosine of the largest angle between the pad's axis and the normal under its centre.
    facing: f64,
    /// How far before the line that it is led along the pad's centre is; negative: behind; 0 of a tool
    /// that works from afar, which faces what is on the line. \[m\]
    stand_off: f64,
    /// How much farther a point that lies too aslant stays than the nearest one. \[m\]
    graze: f64,
    /// Farthest from the line that the nearest point is; infinite for a tool that touches. \[m\]
    farthest: f64,
}

impl Bed {
    /// Of a scene, for a tool.
    #[must_use]
    pub fn new(scene: &Scene, tool: &Tool) -> Self {
        let Scene { surface, surroundings, raw, .. } = scene;
        let points: Vec<Point3<f64>> =
            surface.points.iter().chain(surroundings).chain(raw).copied().collect();
        // Nothing presses on a tool that works from afar.
        let (deepest, highest) = if tool.touches() {
            let deepest = (tool.press_max - SPARE).max(0.0) + tool.stand_off;
            (deepest, HIGHEST - tool.stand_off.min(0.0))
        } else {
            (f64::INFINITY, 0.0)
        };
        let (surface, radius) = (Surface::new(surface), 0.5 * tool.length.max(tool.width));
        let grid = Grid::new(&points, radius);
        let (stand_off, graze, spare) =
            if tool.touches() { (tool.stand_off, GRAZE, 0.0) } else { (0.0, AFAR.0, AFAR.1) };
        let facing = libm::cos((tool.reach_angle - spare).max(0.0));
        let [near, far] = tool.distance();
        let room = FACED.min(tool.stand_off - near).min(far - tool.stand_off);
        let farthest = if tool.touches() { f64::INFINITY } else { (room - graze).max(0.0) };
        Self { surface, points, grid, radius, deepest, highest, facing, stand_off, graze, farthest }
    }

    /// A surface into which the pad may be pressed as deep as it likes, in any direction.
    #[must_use]
    pub fn soft(surface: Surface) -> Self {
        let (points, grid) = (Vec::new(), Grid::new(&[], 1.0));
        let deepest = f64::INFINITY;
        let (highest, facing, stand_off, graze) = (0.0, -1.0, 0.0, GRAZE);
        let (radius, farthest) = (0.0, f64::INFINITY);
        Self { surface, points, grid, radius, deepest, highest, facing, stand_off, graze, farthest }
    }

    /// The surface as it is.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// The patch as the pad comes to lie on it: where something presses it in too deep tilted so
    /// that this is least, then raised. Where the pad would not sweep the point under its centre, as
    /// that lies too aslant, that point's normal takes the place of the patch's, or one near it.
    ///
    /// `None` where there is no surface under its middle (on a sparse scan few points may make a plane,
    /// and none of them be near it), or the pad faces it in no way.
    #[must_use]
    pub fn laid(&self, patch: Patch) -> Option<Patch> {
        let foot = self.surface.project(&patch.centre, &patch.normal)?;
        // A plane through uneven points has its centre off the surface.
        let off = (patch.centre - foot.point).dot(&patch.normal).max(0.0);
        let most = (self.highest - off).max(0.0);
        let own = self.surface.normal_near(&patch.centre).unwrap_or(patch.normal);
        let over = |normal| self.over(&SurfacePoint { point: patch.centre, normal }).max(0.0);
        let raised = |normal: UnitVector3<f64>, over: f64| Patch {
            centre: patch.centre + normal.scale(over.min(most)),
            normal,
            ..patch.clone()
        };
        let faces = |normal: &UnitVector3<f64>| self.faces(&patch.centre, normal);
        let upright = if faces(&patch.normal) { patch.normal } else { own };
        let mut best = (over(upright), upright);
        if best.0 > 0.0 {
            for normal in tilts(&upright).filter(faces) {
                let over = over(normal);
                if over < best.0 - 1e-4 {
                    best = (over, normal);
                }
            }
        }
        let stands = |patch: &Patch| self.faces(&patch.centre, &patch.normal);
        let first = raised(best.1, best.0);
        if stands(&first) {
            return Some(first);
        }
        let others = tilts(&own).map(|normal| (over(normal), normal));
        let others = others.map(|(over, normal)| (over, raised(normal, over)));
        let least = others.filter(|(_, patch)| stands(patch)).min_by(|a, b| a.0.total_cmp(&b.0));
        least.map(|(_, patch)| patch)
    }

    /// [`Surface::line`], raised between its ends. `None` too where the pad would not sweep the
    /// point under its centre, as that lies too aslant.
    #[must_use]
    pub fn line(
        &self,
        a: &SurfacePoint,
        b: &SurfacePoint,
        step: f64,
        wave: f64,
    ) -> Option<Vec<SurfacePoint>> {
        let mut line = self.surface.line(a, b, step, wave)?;
        let last = line.len() - 1;
        // The ends stand where they are asked to, and between them the line is as much off the
        // surface as they are.
        let off = |end: &SurfacePoint| {
            let foot = self.surface.project(&end.point, &end.normal);
            foot.map_or(0.0, |foot| (end.point - foot.point).dot(&end.normal).max(0.0))
        };
        let (from, to) = (off(a), off(b));
        let mut lifts = vec![0.0; line.len()];
        for (i, at) in line.iter().enumerate().take(last).skip(1) {
            let share = i as f64 / last as f64;
            lifts[i] = self.lift(at, from * (1.0 - share) + to * share);
        }
        if lifts.iter().any(|lift| *lift > 0.0) {
            let steps: Vec<f64> =
                line.windows(2).map(|w| STEEPEST * (w[1].point - w[0].point).norm()).collect();
            for i in 1..last {
                lifts[i] = lifts[i].max(lifts[i - 1] - steps[i - 1]);
            }
            for i in (1..last).rev() {
                lifts[i] = lifts[i].max(lifts[i + 1] - steps[i]);
            }
            for (at, lift) in line.iter_mut().zip(&lifts) {
                at.point += at.normal.scale(*lift);
            }
        }
        self.faces_along(&line).then_some(line)
    }

    /// Whether the pad would sweep the points under its centre.
    fn faces_along(&self, line: &[SurfacePoint]) -> bool {
        line.windows(2).all(|w| self.faces_between(&w[0], &w[1]))
    }

    /// Whether a pad that is led through `point` would sweep what is there, and what is where its
    /// centre comes to be.
    fn faces(&self, point: &Point3<f64>, axis: &UnitVector3<f64>) -> bool {
        let at = SurfacePoint { point: *point, normal: *axis };
        self.faces_between(&at, &at)
    }

    /// Whether a pad that is led from one place to the next would sweep what is there, and what is where
    /// its centre comes to be: at no place on the way is the nearest point one that lies too aslant.
    /// What is far from being the nearest does not become it for as long as its lead lasts.
    fn faces_between(&self, from: &SurfacePoint, to: &SurfacePoint) -> bool {
        if !self.keeps_near(&from.point, &to.point) {
            return false;
        }
        let is_aslant =
            |n: &UnitVector3<f64>| from.normal.dot(n).min(to.normal.dot(n)) < self.facing;
        [0.0, self.stand_off].into_iter().all(|off| {
            let start = from.point + from.normal.scale(off);
            let way = to.point + to.normal.scale(off) - start;
            let length = way.norm();
            let mut gone = 0.0;
            loop {
                let at = start + way.scale(if length > 0.0 { gone / length } else { 0.0 });
                let near = self.surface.distance_to(&at, f64::INFINITY, |_| true);
                // Without a surface there is nothing to face.
                let near = near.unwrap_or(f64::INFINITY);
                let reach = near + 2.0 * (length - gone) + self.graze;
                let Some(aslant) = self.surface.distance_to(&at, reach, is_aslant) else {
                    return true;
                };
                if aslant < near + self.graze {
                    return false;
                }
                if gone >= length {
                    return true;
                }
                gone = (gone + (0.5 * (aslant - near - self.graze)).max(CREEP)).min(length);
            }
        })
    }

    /// Whether the surface is nowhere farther from the way between two places than the tool's bounds
    /// allow. No distance to it changes by more than one goes.
    fn keeps_near(&self, from: &Point3<f64>, to: &Point3<f64>) -> bool {
        if self.farthest.is_infinite() {
            return true;
        }
        let way = to - from;
        let length = way.norm();
        let mut gone = 0.0;
        loop {
            let at = from + way.scale(if length > 0.0 { gone / length } else { 0.0 });
            let Some(near) = self.surface.distance_to(&at, self.farthest, |_| true) else {
                return false;
            };
            if gone >= length {
                return true;
            }
            gone = (gone + (self.farthest - near).max(CREEP)).min(length);
        }
    }

    /// How far a pad with its centre here, already so far `off` the surface, has to be raised along
    /// the normal. \[m\]
    fn lift(&self, at: &SurfacePoint, off: f64) -> f64 {
        self.over(at).clamp(0.0, (self.highest - off).max(0.0))
    }

    /// How much too deep a pad with its centre here is pressed in; negative: what is left. \[m\]
    fn over(&self, at: &SurfacePoint) -> f64 {
        let mut highest = 0.0_f64;
        if !self.points.is_empty() {
            let reach = libm::hypot(self.radius, UNEVEN);
            self.grid.within(&at.point, reach, |_, p, squared| {
                let height = (p - at.point).dot(&at.normal);
                let beside = squared - height * height;
                if height <= UNEVEN && beside <= self.radius * self.radius {
                    highest = highest.max(height);
                }
            });
        }
        highest - self.deepest
    }
}

/// Directions about `normal`, the nearest to it first.
fn tilts(normal: &UnitVector3<f64>) -> impl Iterator<Item = UnitVector3<f64>> {
    let (e1, e2) = tangents(normal);
    let normal = normal.into_inner();
    TILTS.into_iter().flat_map(move |tilt| {
        (0..TURNS).map(move |k| {
            let turn = TAU * k as f64 / TURNS as f64;
            let aside = e1 * libm::cos(turn) + e2 * libm::sin(turn);
            UnitVector3::new_normalize(normal * libm::cos(tilt) + aside * libm::sin(tilt))
        })
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use nullsweep_surface::Scan;

    use super::*;

    /// A floor of 40 × 40 cm with a ridge of some height along y.
    fn ridge(height: f64) -> Scene {
        let at = |n: i32| 0.004 * f64::from(n) - 0.2;
        let points: Vec<Point3<f64>> = (0..10_000)
            .map(|i| {
                let (x, y) = (at(i % 100), at(i / 100));
                let over = (1.0 - (x / 0.03).powi(2)).max(0.0);
                Point3::new(x, y, height * over)
            })
            .collect();
        let up = UnitVector3::new_normalize(Vector3::z());
        let normals = vec![up; points.len()];
        Scene::on_floor(Scan { raw: points.clone(), points, normals, spacing: 0.004 })
    }

    fn flat(x: f64) -> SurfacePoint {
        SurfacePoint {
            point: Point3::new(x, 0.0, 0.0),
            normal: UnitVector3::new_normalize(Vector3::z()),
        }
    }

    /// A pad that is laid onto the surface.
    fn laid() -> Tool {
        Tool { stand_off: 0.0, ..Tool::default() }
    }

    #[test]
    fn a_pad_that_is_pressed_in_is_raised_by_so_much_more() {
        let pressed = Tool { stand_off: -0.004, ..Tool::default() };
        // 10 mm less what is spared and what it is pressed in are left.
        let most = HIGHEST + 0.004;
        for (height, lift) in [(0.005, 0.0), (0.008, 0.0025), (0.013, 0.0075), (0.024, most)] {
            let found = Bed::new(&ridge(height), &pressed).lift(&flat(0.04), 0.0);
            assert!((found - lift).abs() < 1e-4, "{height} m: {found}");
        }
    }

    #[test]
    fn the_pad_is_raised_where_something_presses_it_in_too_deep() {
        let tool = laid();
        let bed = Bed::new(&ridge(0.013), &tool);
        // 13 mm press on a pad that gives way by 10.
        let lift = bed.lift(&flat(0.04), 0.0);
        assert!((lift - 0.0035).abs() < 1e-4, "{lift}");
        assert_eq!(bed.lift(&flat(0.15), 0.0), 0.0);
        let bed = Bed::new(&ridge(0.009), &tool);
        assert_eq!(bed.lift(&flat(0.04), 0.0), 0.0);
        // A thing that stands higher is not lain on, and no farther is the pad raised.
        for (height, lift) in [(0.012, 0.0025), (0.024, HIGHEST), (0.03, 0.0)] {
            let mut thing = ridge(0.0);
            thing.surroundings.push(Point3::new(0.15, 0.0, height));
            let found = Bed::new(&thing, &tool).lift(&flat(0.13), 0.0);
            assert!((found - lift).abs() < 1e-9, "{height} m: {found}");
        }
    }

    #[test]
    fn a_patch_faces_what_is_under_it_where_it_comes_to_lie_or_is_none() {
        // One point of a floor leans by 50°.
        let mut scene = ridge(0.0);
        let at = Point3::new(0.04, 0.0, 0.0);
        let leans = |p: &Point3<f64>| (p - at).norm() < 0.002;
        let leaning = scene.surface.points.iter().position(leans).expect("a floor has points");
        let aslant =
            Vector3::new(0.0, libm::sin(50f64.to_radians()), libm::cos(50f64.to_radians()));
        scene.surface.normals[leaning] = UnitVector3::new_normalize(aslant);
        let up = UnitVector3::new_normalize(Vector3::z());
        let patch = |centre| Patch { centre, normal: up, points: Vec::new(), rmse: 0.0 };
        let pressed = Tool { stand_off: -0.004, ..Tool::default() };
        let bed = Bed::new(&scene, &pressed);
        // By its own normal the pad would face that point, but not what is under its pressed centre.
        assert_eq!(bed.laid(patch(at)), None);
        let beside = bed.laid(patch(Point3::new(0.04, 0.012, 0.0))).expect("an even floor");
        assert!(bed.faces(&beside.centre, &beside.normal));
        assert_eq!(bed.laid(patch(Point3::new(0.0, 0.5, 0.0))), None, "over nothing");
    }

    #[test]
    fn a_patch_off_the_surface_is_raised_by_so_much_less() {
        let tool = laid();
        let mut scene = ridge(0.0);
        // Something all around, so that no tilt keeps the pad away from it.
        for (x, y) in [(0.02, 0.0), (0.08, 0.0), (0.05, -0.03), (0.05, 0.03)] {
            scene.surroundings.push(Point3::new(x, y, 0.02));
        }
        let bed = Bed::new(&scene, &tool);
        for z in [0.0, 0.0015, 0.003] {
            let normal = UnitVector3::new_normalize(Vector3::z());
            let centre = Point3::new(0.05, 0.0, z);
            let patch = Patch { centre, normal, points: Vec::new(), rmse: 0.0 };
            let found = bed.laid(patch).expect("a floor").centre;
            assert!((found.z - HIGHEST).abs() < 5e-4, "{z} m: {found}");
        }
    }

    #[test]
    fn a_point_that_is_under_the_pad_for_half_a_millimetre_is_faced_or_not_passed() {
        let mut scene = ridge(0.0);
        let leans = |p: &Point3<f64>| (p - Point3::new(0.04, 0.0, 0.0)).norm() < 0.002;
        let leaning = scene.surface.points.iter().position(leans).expect("a floor has points");
        let aslant =
            Vector3::new(0.0, libm::sin(50f64.to_radians()), libm::cos(50f64.to_radians()));
        scene.surface.normals[leaning] = UnitVector3::new_normalize(aslant);
        let bed = Bed::new(&scene, &laid());
        // It is the nearest one within 2 mm to all sides; a way cuts a corner of that.
        let passes = |inside: f64| {
            let middle = Point3::new(0.042 - inside, 0.002 - inside, 0.0);
            let at = |along: f64| SurfacePoint {
                point: middle + Vector3::new(along, -along, 0.0),
                normal: flat(0.0).normal,
            };
            bed.faces_between(&at(-0.0027), &at(0.0015))
        };
        assert!(!passes(0.0002));
        assert!(passes(-0.0006));
    }

    #[test]
    fn a_line_is_raised_gently_and_its_ends_stay() {
        let tool = laid();
        let bed = Bed::new(&ridge(0.013), &tool);
        let (a, b) = (flat(-0.15), flat(-0.035));
        let line = bed.line(&a, &b, 0.006, 0.07).unwrap();
        assert_eq!((line[0], line[line.len() - 1]), (a, b));
        let lowered = bed.surface.line(&a, &b, 0.006, 0.07).unwrap();
        let lifts: Vec<f64> =
            line.iter().zip(&lowered).map(|(p, q)| (p.point - q.point).dot(&q.normal)).collect();
        assert!(lifts.iter().any(|lift| *lift > 0.002), "{lifts:?}");
        assert!(lifts.windows(2).take(lifts.len() - 2).all(|w| (w[1] - w[0]).abs() < 0.003));
    }
}
