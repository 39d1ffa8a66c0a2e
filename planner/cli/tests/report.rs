//! The report's page: complete, self-contained, small enough, safe with any text.

use nalgebra::Point3;
use nullsweep_planner::sweep::coverage;
use nullsweep_report::{
    self as report, JointAxis, Motion, PatchMark, ReportData, ReportError, Table,
};
use nullsweep_robot::Tool;
use nullsweep_surface::{
    CleanConfig, PatchConfig, Placement, Scan, Surface, SurfacePoint, patches, scan, simulate,
};

/// A chair with rows of lines over its patches: as much to show as a real run has.
fn example() -> ReportData {
    let view = simulate::chair(1);
    let (placed, _) = scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    let (scan, _) = scan::clean(&placed, &CleanConfig::default()).unwrap();
    let patches = patches::find(&scan, &PatchConfig::default(), 1);
    let surface = Surface::new(&scan);
    let end = |i: usize| SurfacePoint { point: patches[i].centre, normal: patches[i].normal };
    let mut edges = Vec::new();
    for a in 0..patches.len() {
        for b in a + 1..patches.len() {
            if (patches[a].centre - patches[b].centre).norm() < 0.07 {
                edges.extend(surface.line(&end(a), &end(b), 0.01, 0.07));
            }
        }
    }
    let (plan, swept) = motion(&scan, &edges);
    let mut measured = plan.clone();
    measured.name = "measured".into();
    for positions in &mut measured.joints {
        for (i, q) in positions.iter_mut().enumerate() {
            *q += 0.02 * (i as f64 * 0.05).sin();
        }
    }
    let names = ["r_shoulder_pan_joint", "r_shoulder_lift_joint", "r_upper_arm_roll_joint"];
    ReportData {
        title: "Chair, <simulated> & \"wiped\"".into(),
        subtitle: "seed 1".into(),
        tables: vec![Table {
            title: "Run".into(),
            columns: vec!["".into(), "plan".into()],
            rows: vec![vec!["patches".into(), patches.len().to_string()]],
        }],
        points: scan.points.clone(),
        swept,
        patches: patches
            .iter()
            .map(|patch| PatchMark {
                centre: patch.centre,
                normal: patch.normal,
                unreachable: (patch.centre.z < 0.3).then(|| "</script> in collision".to_owned()),
            })
            .collect(),
        edges: edges.iter().map(|e| e.iter().map(|s| s.point).collect()).collect(),
        joints: names
            .iter()
            .map(|name| JointAxis { name: (*name).to_owned(), limits: Some((-2.0, 0.7)) })
            .collect(),
        plans: vec![plan],
        measured: vec![measured],
    }
}

/// Every tenth edge in turn with transfers between them, and what a pad along them would sweep.
fn motion(scan: &Scan, edges: &[Vec<SurfacePoint>]) -> (Motion, Vec<bool>) {
    let mut plan = Motion { name: "plan".into(), joints: vec![Vec::new(); 3], ..Motion::default() };
    let mut poses = Vec::new();
    for edge in edges.iter().step_by(10) {
        for stop in edge {
            plan.tool.push(stop.point);
            plan.contact.push(true);
            let into = nalgebra::UnitQuaternion::rotation_between(
                &nalgebra::Vector3::z(),
                &-stop.normal.into_inner(),
            );
            poses.push(nalgebra::Isometry3::from_parts(
                stop.point.coords.into(),
                into.unwrap_or_default(),
            ));
        }
        let last = edge[edge.len() - 1];
        for height in [0.05, 0.08, 0.05] {
            plan.tool.push(last.point + last.normal.scale(height));
            plan.contact.push(false);
        }
    }
    plan.times = (0..plan.tool.len()).map(|i| 0.05 * i as f64).collect();
    for (joint, positions) in plan.joints.iter_mut().enumerate() {
        let phase = joint as f64;
        positions.extend(plan.times.iter().map(|t| (t * 0.7 + phase).sin() - 0.7));
    }
    let swept = coverage::swept(scan, &poses, &Tool::default());
    (plan, swept)
}

#[test]
fn a_full_report_is_self_contained_and_small() {
    let data = example();
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html");
    report::write(&path, &data).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();
    assert!(page.len() < 8_000_000, "{} bytes", page.len());
    // The library, the page's first script, is text of others that mentions addresses.
    let (head, rest) = page.split_once("<script").unwrap();
    let (_, own) = rest.split_once("</script>").unwrap();
    for needle in ["http", "src=", "<link", "@import"] {
        assert!(!head.contains(needle) && !own.contains(needle), "the page loads {needle}");
    }
    assert_eq!(own.matches("Plotly.newPlot(").count(), 2, "the scene and the joints");
    // Each script that is opened is closed once: no text of the data ends one.
    assert_eq!(own.matches("<script").count(), own.matches("</script>").count());
    assert!(page.contains("<h1>Chair, &lt;simulated&gt; &amp; &quot;wiped&quot;</h1>"));
    for text in ["scan, not swept", "not reachable", "transfers", "measured", "soft limits"] {
        assert!(page.contains(text), "{text} is missing");
    }
}

#[test]
fn an_empty_report_is_a_page_too() {
    let page = report::render(&ReportData::default()).unwrap();
    assert!(page.contains("</html>") && !page.contains("Joints over time"));
}

#[test]
fn lists_that_do_not_run_parallel_are_named() {
    let data = ReportData {
        points: vec![Point3::origin(); 3],
        swept: vec![true; 2],
        ..ReportData::default()
    };
    let error = report::render(&data).unwrap_err();
    assert!(matches!(error, ReportError::Length { found: 2, expected: 3, .. }), "{error}");
    let data = ReportData {
        plans: vec![Motion {
            name: "first".into(),
            times: vec![0.0, 1.0],
            tool: vec![Point3::origin()],
            ..Motion::default()
        }],
        ..ReportData::default()
    };
    assert_eq!(
        report::render(&data).unwrap_err().to_string(),
        "report: tool path of first has 1 entries, 2 are due"
    );
}
