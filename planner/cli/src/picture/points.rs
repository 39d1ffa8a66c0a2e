//! The scan by what was swept, and what is left by cause and place.

use nalgebra::{Point3, UnitVector3, Vector3};
use nullsweep_planner::plan::{Plan, Stretch};
use nullsweep_planner::regions::{Kind, Region};
use nullsweep_planner::sweep::coverage;
use nullsweep_planner::verify::Verification;
use nullsweep_planner::workcell::Scene;
use nullsweep_report::{Cloud, LeftPoint, Paint, PlaceGroup, places};
use nullsweep_robot::Arm;
use nullsweep_surface::Scan;

/// Why a point may be left of which the plan does not say it.
const CAUSES: [&str; 3] = [
    "no arm pose free of collision touches it",
    "reachable, but no motion was found that leads there",
    "beside the path: the pad passes near, but not over it",
];

/// What is known of a plan's points.
pub(super) struct Points {
    pub(super) clouds: Vec<Cloud>,
    pub(super) places: Vec<PlaceGroup>,
    /// How many there are.
    pub(super) all: usize,
    /// How many are left.
    pub(super) left: usize,
    /// Shares of swept points: of those that are reachable, of all; `None`: there are none.
    pub(super) shares: [Option<f64>; 2],
}

impl Points {
    /// Those of a plan, with what else is there, in the root frame.
    pub(super) fn of(
        plan: &Plan,
        arm: &Arm,
        here: Option<&Scene>,
        verification: Option<&Verification>,
    ) -> Self {
        let scan = surface(plan);
        let swept = match verification {
            _ if plan.is_of_poses() => met(plan),
            Some(found) if found.swept.len() == scan.points.len() => found.swept.clone(),
            _ => {
                let past = plan.past.iter().map(Stretch::trajectory);
                coverage::swept_by(&scan, past.chain([plan.trajectory()]), arm)
            }
        };
        let left = |i: usize, cause: usize| LeftPoint {
            at: scan.points[i],
            normal: scan.normals[i],
            cause,
        };
        let told = plan.left.iter().map(|left| left.cause.clone());
        let names: Vec<String> = told.chain(CAUSES.map(str::to_owned)).collect();
        let cause = causes(plan);
        let points = (0..swept.len()).filter(|i| !swept[*i]);
        let left: Vec<LeftPoint> = points.map(|i| left(i, cause(i))).collect();
        let some = |want: bool| {
            let all = scan.points.iter().zip(&swept);
            all.filter(|(_, s)| **s == want).map(|(p, _)| *p).collect()
        };
        let cloud = |name: &str, paint, points: Vec<Point3<f64>>| Cloud {
            name: name.into(),
            paint,
            points,
            shown: true,
        };
        let (done, things) =
            if plan.is_of_poses() { ("met", "poses") } else { ("swept", "points") };
        let mut clouds =
            vec![cloud(done, Paint::Swept, some(true)), cloud("left", Paint::Left, some(false))];
        if let Some(scene) = here {
            clouds.push(cloud("around", Paint::Around, scene.surroundings.clone()));
            let unseen = cloud("unseen space", Paint::Unseen, scene.unseen.clone());
            clouds.push(Cloud { shown: false, ..unseen });
            clouds.extend(regions(scene));
        }
        Self {
            clouds,
            places: places(&names, &left, (swept.len(), things)),
            all: swept.len(),
            left: left.len(),
            shares: shares(plan, &swept),
        }
    }
}

/// The points of each region.
fn regions(scene: &Scene) -> impl Iterator<Item = Cloud> {
    let of = |(index, region): (usize, &Region)| Cloud {
        name: format!("region {}", region.name),
        paint: Paint::Numbered(index),
        points: match region.kind {
            Kind::Sweep(_) => {
                let points = scene.surface.points.iter();
                points.filter(|p| region.contains(p)).copied().collect()
            }
            Kind::KeepOut => {
                scene.keep_out.iter().filter(|p| region.contains(p)).copied().collect()
            }
            Kind::Avoid => Vec::new(),
        },
        shown: false,
    };
    let all = scene.regions.all().iter().enumerate().map(of);
    all.filter(|cloud| !cloud.points.is_empty())
}

/// Shares of swept points: of those that are reachable, of all; `None`: there are none.
pub(super) fn shares(plan: &Plan, swept: &[bool]) -> [Option<f64>; 2] {
    let share = |of: &dyn Fn(usize) -> bool| {
        let all = (0..swept.len()).filter(|i| of(*i)).count();
        let hit = (0..swept.len()).filter(|i| of(*i) && swept[*i]).count();
        (all > 0).then(|| hit as f64 / all as f64)
    };
    [share(&|i| plan.surface[i].reachable), share(&|_| true)]
}

/// The points that the plan is to sweep.
pub(super) fn surface(plan: &Plan) -> Scan {
    let normal = |n: [f64; 3]| UnitVector3::new_normalize(Vector3::from(n));
    Scan {
        points: plan.surface.iter().map(|s| Point3::from(s.point)).collect(),
        normals: plan.surface.iter().map(|s| normal(s.normal)).collect(),
        raw: Vec::new(),
        spacing: 0.0,
    }
}

/// Which of the given poses a plan meets.
fn met(plan: &Plan) -> Vec<bool> {
    let mut met = vec![false; plan.patches.len()];
    for pose in plan.knots.iter().filter_map(|knot| knot.patch) {
        if let Some(met) = met.get_mut(pose as usize) {
            *met = true;
        }
    }
    met
}

/// For a point of a plan that is left: which of the causes that the plan tells, and of [`CAUSES`] behind
/// them.
fn causes(plan: &Plan) -> impl Fn(usize) -> usize {
    let mut told = vec![None; plan.surface.len()];
    for (cause, left) in plan.left.iter().enumerate() {
        for point in &left.points {
            if let Some(told) = told.get_mut(*point as usize) {
                *told = Some(cause);
            }
        }
    }
    let others = plan.left.len();
    let mut visited = vec![false; plan.patches.len()];
    let stretches = plan.past.iter().map(|s| &s.knots).chain([&plan.knots]);
    for patch in stretches.flatten().filter_map(|knot| knot.patch) {
        if let Some(seen) = visited.get_mut(patch as usize) {
            *seen = true;
        }
    }
    move |i| {
        let sample = &plan.surface[i];
        if let Some(cause) = told[i] {
            return cause;
        }
        if !sample.reachable {
            return others;
        }
        let at = Point3::from(sample.point);
        let away = |p: usize| (Point3::from(plan.patches[p]) - at).norm_squared();
        let nearest = (0..visited.len()).min_by(|a, b| away(*a).total_cmp(&away(*b)));
        others + if nearest.is_some_and(|p| visited[p]) { 2 } else { 1 }
    }
}
