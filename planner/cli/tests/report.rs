//! The report's page: complete, self-contained, small enough, safe with any text.

use nalgebra::Point3;
use nullsweep_report::{
    self as report, Body, Cloud, Headline, JointAxis, Motion, Paint, PlaceGroup, ReportData,
    ReportError, Table, Tone,
};
use nullsweep_surface::{CleanConfig, Placement, scan, simulate};

/// A chair with an arm of one joint before it: as much to show as a real run has.
fn example() -> ReportData {
    let view = simulate::chair(1);
    let (placed, _) = scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    let (scan, _) = scan::clean(&placed, &CleanConfig::default()).unwrap();
    let times: Vec<f64> = (0..6000).map(|i| 0.02 * f64::from(i)).collect();
    let wave = |phase: f64| times.iter().map(|t| (t * 0.7 + phase).sin()).collect::<Vec<_>>();
    let motion = |name: &str| Motion {
        name: name.into(),
        joints: (0..7).map(|j| wave(f64::from(j))).collect(),
        contact: times.iter().map(|t| t.sin() > 0.0).collect(),
        times: times.clone(),
        ..Motion::default()
    };
    let swept = |p: &&Point3<f64>| p.z > 0.3;
    let cloud = |name: &str, paint, points: Vec<Point3<f64>>| Cloud {
        name: name.into(),
        paint,
        points,
        shown: true,
    };
    ReportData {
        title: "Chair, <simulated> & \"wiped\"".into(),
        subtitle: "seed 1".into(),
        headline: vec![Headline {
            label: "Swept".into(),
            value: "87 %".into(),
            detail: "of <all>".into(),
            tone: Tone::Good,
        }],
        notes: vec!["Guessed: </script> of everything".into()],
        tables: vec![Table {
            title: "Run".into(),
            columns: vec!["".into(), "plan".into()],
            rows: vec![vec!["points".into(), scan.points.len().to_string()]],
        }],
        places: vec![PlaceGroup { name: "</script> in collision".into(), ..PlaceGroup::default() }],
        clouds: vec![
            cloud("swept", Paint::Swept, scan.points.iter().filter(swept).copied().collect()),
            cloud("around", Paint::Around, scan.raw.clone()),
        ],
        joints: (0..7)
            .map(|j| JointAxis {
                name: format!("joint {j}"),
                unit: "rad",
                limits: Some((-2., 0.7)),
            })
            .collect(),
        plans: vec![motion("plan")],
        measured: vec![motion("measured")],
        ..ReportData::default()
    }
}

#[test]
fn a_full_report_is_self_contained_and_small() {
    let data = example();
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html");
    report::write(&path, &data).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();
    assert!(page.len() < 2_000_000, "{} bytes", page.len());
    for needle in ["http", "src=", "@import", "url(", "fetch(", "import("] {
        assert!(!page.contains(needle), "the page loads {needle}");
    }
    // Each script that is opened is closed once: no text of the data ends one.
    assert_eq!(page.matches("<script").count(), 2, "the data and the page's own");
    assert_eq!(page.matches("</script>").count(), 2);
    assert!(page.contains("<h1>Chair, &lt;simulated&gt; &amp; &quot;wiped&quot;</h1>"));
    for text in ["of &lt;all&gt;", "Guessed: &lt;/script&gt; of everything", "87 %", "Run"] {
        assert!(page.contains(text), "{text} is missing");
    }
}

#[test]
fn an_empty_report_is_a_page_too() {
    let page = report::render(&ReportData::default()).unwrap();
    assert!(page.contains("</html>") && !page.contains("id=\"play\""));
}

#[test]
fn lists_that_do_not_run_parallel_are_named() {
    let joint = JointAxis { name: "elbow".into(), unit: "rad", limits: None };
    let motion = |joints: Vec<Vec<f64>>| ReportData {
        joints: vec![joint.clone()],
        plans: vec![Motion {
            name: "first".into(),
            times: vec![0.0, 1.0],
            joints,
            ..Motion::default()
        }],
        ..ReportData::default()
    };
    let told = |data: &ReportData| report::render(data).unwrap_err().to_string();
    let short = told(&motion(vec![vec![0.0]]));
    assert_eq!(short, "report: elbow of first has 1 entries, 2 are due");
    let missing = told(&motion(Vec::new()));
    assert_eq!(missing, "report: joints of first has 0 entries, 1 are due");
    let mut stop = motion(vec![vec![0.0, 0.1]]);
    stop.plans[0].stops = vec![2];
    assert!(matches!(
        report::render(&stop).unwrap_err(),
        ReportError::Index { index: 2, known: 2, .. }
    ));
    let body = Body {
        parent: Some(0),
        rest: nalgebra::Isometry3::identity(),
        axis: nalgebra::Vector3::z_axis(),
        slides: false,
        joint: 0,
        factor: 1.0,
        offset: 0.0,
    };
    let own_parent = ReportData { bodies: vec![body], ..motion(vec![vec![0.0, 0.1]]) };
    assert_eq!(told(&own_parent), "report: parent of body 0 names number 0 of 0");
}
