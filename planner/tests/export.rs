//! Plans as trajectories for other programs.

use nullsweep_planner::plan::export::{Format, write};
use nullsweep_planner::plan::{CostKind, FORMAT, Method, Plan, PlanKnot, Profile};
use nullsweep_robot::{JointVector, Tool};

fn plan(profile: Profile) -> Plan {
    let knot = |time_ns, q: f64, v: f64| PlanKnot {
        time_ns,
        q: JointVector::new([q, -1e-9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        v: JointVector::new([v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        line: Some([0.0; 3]),
        patch: (time_ns > 0).then_some(3),
    };
    Plan {
        format: FORMAT,
        robot: "r".into(),
        fingerprint: 1,
        joints: vec!["one".into(), "two".into()],
        held: Vec::new(),
        tool: Tool::default(),
        base: [0.0; 3],
        base_height: 0.0,
        method: Method::Tsp,
        cost: CostKind::Time,
        profile,
        jerk: None,
        seed: 1,
        knots: vec![knot(0, 0.25, 0.0), knot(1_000_000_005, 0.5, 0.125)],
        patches: Vec::new(),
        surface: Vec::new(),
        regions: Vec::new(),
        continues: None,
        past: Vec::new(),
        left: Vec::new(),
        seal: None,
    }
}

fn text(profile: Profile, format: Format) -> String {
    let mut out = Vec::new();
    write(&plan(profile), format, &mut out).expect("written");
    String::from_utf8(out).expect("text")
}

#[test]
fn ros_reads_the_yaml() {
    let expected = "\
header: {seq: 0, stamp: {secs: 0, nsecs: 0}, frame_id: ''}
joint_names: [one, two]
points:
- positions: [0.25, -0.000000001]
  velocities: [0, 0]
  accelerations: []
  effort: []
  time_from_start: {secs: 0, nsecs: 0}
- positions: [0.5, -0.000000001]
  velocities: [0.125, 0]
  accelerations: []
  effort: []
  time_from_start: {secs: 1, nsecs: 5}
";
    assert_eq!(text(Profile::Acceleration, Format::RosYaml), expected);
    let ros2 = expected.replace("seq: 0, ", "").replace("nsecs", "nanosec").replace("secs", "sec");
    assert_eq!(text(Profile::Acceleration, Format::Ros2Yaml), ros2);
    // Without velocities a controller goes straight from point to point.
    assert!(text(Profile::Velocity, Format::RosYaml).contains("velocities: []"));
}

#[test]
fn tables_and_json_hold_every_knot() {
    let csv = text(Profile::Acceleration, Format::Csv);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "time_from_start,one,two,one_velocity,two_velocity,patch,contact");
    assert_eq!(lines[2], "1.000000005,0.5,-0.000000001,0.125,0,3,1");

    let json: serde_json::Value =
        serde_json::from_str(&text(Profile::Acceleration, Format::Json)).expect("JSON");
    assert_eq!(json["points"][1]["time_from_start"]["nsecs"], 5);
    assert_eq!(json["points"][1]["velocities"][0], 0.125);
    assert_eq!(json["joint_names"][1], "two");
}
