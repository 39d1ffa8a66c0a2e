//! Ways to touch what is to be kept out of.

use nalgebra::{Isometry3, Vector3};
use nullsweep_planner::plan::Plan;
use nullsweep_planner::regions::{Kind, Region, Regions, Shape, Volume};
use nullsweep_planner::verify::ViolationKind;
use nullsweep_planner::workcell::Scene;

use crate::case::Case;
use crate::stage::{on_the_line, pad_centre, stage};

/// The stage's scene, to be kept out of within a distance of a plan's place.
fn kept(plan: &Plan, knot: usize, radius: f64) -> Scene {
    let centre = plan.base_pose() * nalgebra::Point3::from(pad_centre(&plan.knots[knot].q));
    let pose = Isometry3::from_parts(centre.into(), nalgebra::UnitQuaternion::identity());
    let volumes = vec![Volume { shape: Shape::Sphere { radius }, pose }];
    let region = Region { name: "clamp".into(), kind: Kind::KeepOut, volumes };
    stage().scene.clone().with_regions(Regions::new(vec![region])).expect("points are there")
}

/// The first knot by which the pad has come over a point: by its rectangle alone, at the knots.
fn comes_over(plan: &Plan, scene: &Scene) -> usize {
    let to_root = plan.base_pose().inverse();
    let points: Vec<_> = scene.keep_out.iter().map(|p| to_root * p).collect();
    let tool = plan.tool.on(&stage().arm);
    let over = |k: &usize| {
        // Between the knots too, as finely as it moves.
        let curve = plan.curve(*k);
        (0..=200).any(|step| {
            let pose = tool.pose(&curve.at(f64::from(step) / 200.0));
            points.iter().any(|p| {
                let own: Vector3<f64> = pose.inverse_transform_point(p).coords;
                own.x.abs() <= 0.035 && own.y.abs() <= 0.05 && (-0.03..=0.004).contains(&own.z)
            })
        })
    };
    (1..plan.knots.len()).find(over).expect("it comes there")
}

pub(crate) fn cases() -> Vec<Case> {
    let s = stage();
    let case = |what, plan: &Plan, radius| {
        let scene = kept(plan, on_the_line(plan), radius);
        let knot = comes_over(plan, &scene);
        Case {
            scene: Some(scene),
            also: &[ViolationKind::Collision],
            ..Case::new(what, plan.clone(), knot, "which it is to keep out of")
        }
    };
    vec![
        case("over a spot that is to be kept out of", &s.bang, 0.012),
        case("over a wide one, accelerations limited", &s.smooth, 0.05),
    ]
}
