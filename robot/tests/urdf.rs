//! URDFs that are refused, and what becomes of those that are not.

use std::path::Path;
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Vector3};
use nullsweep_robot::{
    ArmError, ArmSpec, Geometry, JointKind, JointLimits, JointVector, Robot, Side, Solutions,
    UrdfError,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A robot from links and joints.
fn robot(links: &str, joints: &str) -> Result<Robot, UrdfError> {
    let links: String = links.split(' ').map(|l| format!("<link name='{l}'/>")).collect();
    Robot::from_urdf_str(&format!("<robot name='test'>{links}{joints}</robot>"))
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, inner: &str) -> String {
    format!(
        "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
         {inner}</joint>"
    )
}

const LIMIT: &str = "<limit lower='-1' upper='2' effort='1' velocity='3'/>";

fn spec(base: &str, tip: &str) -> ArmSpec {
    ArmSpec { base: base.into(), tip: tip.into() }
}

#[test]
fn files_that_are_no_robot() {
    let missing = Robot::from_urdf_file(Path::new("no/such/robot.urdf")).unwrap_err();
    assert!(matches!(missing, UrdfError::Read { .. }) && missing.to_string().contains("no/such"));
    for text in
        ["", "not xml", "<robot", "<robot><link name='a'></robot>", "<robot><link/></robot>"]
    {
        let error = Robot::from_urdf_str(text).unwrap_err();
        assert!(matches!(error, UrdfError::Parse { .. } | UrdfError::Empty), "{text}: {error}");
    }
    assert!(matches!(Robot::from_urdf_str("<robot name='r'/>"), Err(UrdfError::Empty)));
}

/// Depth costs the reader stack, and time that grows with its square.
#[test]
fn deep_nesting_is_refused_at_once() {
    let nested = |depth: usize| {
        let (open, close) = ("<x>".repeat(depth), "</x>".repeat(depth));
        format!("<robot name='r'><link name='a'/>{open}{close}</robot>")
    };
    let start = Instant::now();
    for depth in [128, 20_000, 300_000] {
        let error = Robot::from_urdf_str(&nested(depth)).unwrap_err().to_string();
        let place = 32 + 3 * 128;
        let expected = format!("<x> near byte {place} is nested more than 128 deep");
        assert!(error.contains(&expected), "{error}");
    }
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    Robot::from_urdf_str(&nested(127)).unwrap();
    // The same behind an entity, which the reader expands.
    let open = "<x>".repeat(20_000);
    let hidden = format!(
        "<!DOCTYPE robot [<!ENTITY e \"{open}{}\">]><robot name='r'><link name='a'/>&e;</robot>",
        "</x>".repeat(20_000)
    );
    let error = Robot::from_urdf_str(&hidden).unwrap_err().to_string();
    assert!(error.contains("entities are declared"), "{error}");
}

#[test]
fn broken_trees_are_named() {
    let fixed = |name: &str, parent: &str, child: &str| joint(name, "fixed", parent, child, "");
    let error = robot("a b c", &fixed("j", "a", "b")).unwrap_err();
    assert!(matches!(&error, UrdfError::ManyRoots { roots } if roots == &["a", "c"]), "{error}");
    let error = robot("a b", &fixed("j", "a", "x")).unwrap_err();
    assert!(
        matches!(&error, UrdfError::UnknownLink { joint, link } if joint == "j" && link == "x")
    );
    let two = fixed("j", "a", "c") + &fixed("k", "b", "c") + &fixed("l", "a", "b");
    let error = robot("a b c", &two).unwrap_err();
    assert!(matches!(&error, UrdfError::TwoParents { link, .. } if link == "c"), "{error}");
    let cycle = fixed("j", "b", "c") + &fixed("k", "c", "b");
    let error = robot("a b c", &cycle).unwrap_err();
    assert!(matches!(&error, UrdfError::Cycle { links } if links == &["b", "c"]), "{error}");
    let error = robot("b c", &cycle).unwrap_err();
    assert!(matches!(&error, UrdfError::Cycle { links } if links == &["b", "c"]), "{error}");
    let error = robot("a", &fixed("j", "a", "a")).unwrap_err();
    assert!(matches!(error, UrdfError::Cycle { .. }), "{error}");
    let error = robot("a b b", &fixed("j", "a", "b")).unwrap_err();
    assert!(matches!(&error, UrdfError::DuplicateName { what: "link", name } if name == "b"));
    let error = robot("a b c", &(fixed("j", "a", "b") + &fixed("j", "a", "c"))).unwrap_err();
    assert!(matches!(&error, UrdfError::DuplicateName { what: "joint", name } if name == "j"));
}

#[test]
fn bad_numbers_are_named() {
    let one = |kind: &str, inner: &str| robot("a b", &joint("j", kind, "a", "b", inner));
    for kind in ["floating", "planar"] {
        let error = one(kind, "").unwrap_err();
        assert!(
            matches!(&error, UrdfError::UnsupportedJoint { joint, kind: k } if joint == "j" && k == kind)
        );
    }
    let axis = |xyz: &str| format!("<axis xyz='{xyz}'/>{LIMIT}");
    assert!(matches!(one("revolute", &axis("0 0 0")), Err(UrdfError::ZeroAxis { .. })));
    assert!(matches!(one("revolute", &axis("nan 0 1")), Err(UrdfError::NotFinite { .. })));
    // Three numbers, a word among them: urdf-rs alone would take this for (1, 0, 0).
    assert!(matches!(one("revolute", &axis("1 zero 0 0")), Err(UrdfError::Parse { .. })));
    assert!(matches!(one("fixed", "<origin xyz='0 inf 0'/>"), Err(UrdfError::NotFinite { .. })));
    assert!(matches!(one("fixed", "<origin rpy='0 0'/>"), Err(UrdfError::Parse { .. })));
    let swapped = "<limit lower='2' upper='-1' effort='1' velocity='3'/>";
    assert!(matches!(one("revolute", swapped), Err(UrdfError::BadLimits { what: "hard", .. })));
    let negative = "<limit lower='-1' upper='1' effort='1' velocity='-3'/>";
    assert!(matches!(one("revolute", negative), Err(UrdfError::BadLimits { .. })));
    let nan = "<limit lower='nan' upper='1' effort='1' velocity='3'/>";
    assert!(matches!(one("revolute", nan), Err(UrdfError::NotFinite { .. })));
    let soft = format!(
        "{LIMIT}<safety_controller soft_lower_limit='1' soft_upper_limit='0' k_velocity='1'/>"
    );
    assert!(matches!(one("revolute", &soft), Err(UrdfError::BadLimits { what: "soft", .. })));
    for size in ["0 1 1", "-1 1 1", "nan 1 1"] {
        let text = format!(
            "<robot name='r'><link name='a'><collision><geometry><box size='{size}'/></geometry>\
             </collision></link></robot>"
        );
        let error = Robot::from_urdf_str(&text).unwrap_err();
        assert!(matches!(&error, UrdfError::BadGeometry { link } if link == "a"), "{error}");
    }
}

#[test]
fn a_shape_of_size_0_is_left_out_and_counted() {
    for empty in [
        "<box size='0 0 0'/>",
        "<sphere radius='0'/>",
        "<cylinder radius='0' length='0'/>",
        "<capsule radius='0' length='0'/>",
    ] {
        let text = format!(
            "<robot name='r'><link name='a'><collision><geometry>{empty}</geometry></collision>\
             <collision><geometry><sphere radius='1'/></geometry></collision></link></robot>"
        );
        let robot = Robot::from_urdf_str(&text).unwrap();
        let link = &robot.links()[0];
        assert_eq!((link.collisions.len(), link.empty_shapes), (1, 1), "{empty}");
    }
}

#[test]
fn a_xacro_file_is_told_from_its_expansion() {
    let head = "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'>";
    let expanded = format!("{head}<!-- <xacro:include filename='a'/> --><link name='a'/></robot>");
    assert!(Robot::from_urdf_str(&expanded).is_ok());
    for inner in
        ["<xacro:property name='r' value='1'/>", "<xacro:arm><origin xyz='${x} 0'/></xacro:arm>"]
    {
        let error = Robot::from_urdf_str(&format!("{head}{inner}</robot>")).unwrap_err();
        assert!(matches!(error, UrdfError::Xacro), "{error}");
        assert!(error.to_string().contains("`xacro FILE > out.urdf`"), "{error}");
    }
}

#[test]
fn arms_that_cannot_be_are_named() {
    let names: Vec<String> = (0..10).map(|i| format!("l{i}")).collect();
    let chain: String = (0..9)
        .map(|i| joint(&format!("j{i}"), "revolute", &names[i], &names[i + 1], LIMIT))
        .collect();
    let long = robot(&names.join(" "), &chain).unwrap();
    let error = long.arm(&spec("l0", "l9")).err().unwrap();
    assert!(matches!(&error, ArmError::TooManyJoints { joints } if joints.len() == 9), "{error}");
    assert!(error.to_string().contains("j8"));
    assert_eq!(long.arm(&spec("l1", "l9")).unwrap().dof(), 8);
    assert_eq!(long.arm(&spec("l8", "l9")).unwrap().dof(), 1);
    assert!(matches!(long.arm(&spec("l3", "l2")), Err(ArmError::NotAChain { .. })));
    assert!(matches!(long.arm(&spec("l3", "l3")), Err(ArmError::NoJoints { .. })));
    let error = long.arm(&spec("l0", "nowhere")).err().unwrap();
    assert!(matches!(&error, ArmError::UnknownLink { link, .. } if link == "nowhere"));

    for (kind, inner) in [
        ("revolute", ""),
        ("prismatic", ""),
        ("continuous", ""),
        ("revolute", "<limit effort='1' velocity='3'/>"),
        ("revolute", "<limit lower='-1' upper='1' effort='1' velocity='0'/>"),
    ] {
        // Fine as a part of the robot, not as a joint of an arm.
        let robot = robot("a b", &joint("j", kind, "a", "b", inner)).unwrap();
        let error = robot.arm(&spec("a", "b")).err().unwrap();
        assert!(matches!(&error, ArmError::NoLimits { joint } if joint == "j"), "{kind} {inner}");
    }
}

#[test]
fn soft_limits_margins_and_accelerations() {
    let limits = |kind: &str, inner: &str| -> JointLimits {
        let robot = robot("a b", &joint("j", kind, "a", "b", inner)).unwrap();
        robot.arm(&spec("a", "b")).unwrap().limits()[0]
    };
    let plain = limits("revolute", LIMIT);
    assert_eq!((plain.lower, plain.upper, plain.k_position), (-1.0, 2.0, None));
    assert_eq!(plain.acceleration, 3.0 / JointLimits::DEFAULT_ACCELERATION_TIME);
    let safe = "<safety_controller soft_lower_limit='-0.5' soft_upper_limit='9' k_position='10' k_velocity='1'/>";
    let safe = limits("revolute", &format!("{LIMIT}{safe}"));
    // A soft limit past the hard one does not widen it.
    assert_eq!((safe.lower, safe.upper, safe.k_position), (-0.5, 2.0, Some(10.0)));
    // A safety controller without soft limits, as continuous joints have it: urdf-rs says 0 … 0.
    let bare = "<safety_controller k_velocity='1'/>";
    let bare = limits("revolute", &format!("{LIMIT}{bare}"));
    assert_eq!((bare.lower, bare.upper, bare.k_position), (-1.0, 2.0, None));
    let round = limits(
        "continuous",
        "<limit effort='1' velocity='3' acceleration='7'/><safety_controller k_velocity='1'/>",
    );
    assert!(round.continuous && round.lower == f64::NEG_INFINITY && round.upper == f64::INFINITY);
    // Read although the file does not say that it is URDF 1.2.
    assert_eq!((round.acceleration, round.jerk), (7.0, None));
    let jerky = limits("continuous", "<limit effort='1' velocity='3' jerk='50'/>");
    assert_eq!((jerky.acceleration, jerky.jerk), (6.0, Some(50.0)));
    for (jerk, told) in [("0", "jerk"), ("-1", "jerk"), ("inf", "jerk"), ("x", "not a number")] {
        let inner = format!("<limit effort='1' velocity='3' jerk='{jerk}'/>");
        let error = robot("a b", &joint("j", "continuous", "a", "b", &inner)).err().unwrap();
        assert!(error.to_string().contains(told), "{jerk}: {error}");
    }
}

#[test]
fn mimic_joints_follow_and_are_not_held() {
    let finger = "<axis xyz='0 1 0'/><limit lower='0' upper='1' effort='1' velocity='1'/>";
    let joints = joint("arm", "revolute", "base", "hand", LIMIT)
        + &joint("left", "prismatic", "hand", "l", finger)
        + &joint(
            "right",
            "prismatic",
            "hand",
            "r",
            &format!("{finger}<mimic joint='left' multiplier='-2' offset='0.1'/>"),
        )
        + &joint(
            "wheel",
            "revolute",
            "base",
            "w",
            &format!("{LIMIT}<mimic joint='arm' multiplier='0.5'/>"),
        );
    let robot = robot("base hand l r w", &joints).unwrap();
    let arm = robot.arm(&spec("base", "hand")).unwrap();
    let held: Vec<_> = arm.held_joints().iter().map(|h| h.name.as_str()).collect();
    assert_eq!(held, ["left"]);
    let arm = arm.with_held(&[("left", 0.3)]).unwrap();
    let mut poses = vec![Isometry3::identity(); 5];
    let mut q = JointVector::ZERO;
    q[0] = 1.0;
    arm.link_poses(&q, &mut poses);
    let local = |link: usize| (poses[1].inverse() * poses[link]).translation.vector;
    assert!((local(2) - Vector3::y() * 0.3).norm() < 1e-15);
    assert!((local(3) + Vector3::y() * 0.5).norm() < 1e-15);
    assert!((poses[4].rotation.scaled_axis() - Vector3::x() * 0.5).norm() < 1e-15);
    assert_eq!(arm.moving_links(), [1, 4, 2, 3]);
    assert!(matches!(arm.with_held(&[("right", 0.1)]), Err(ArmError::NotHeld { .. })));
    assert!(matches!(arm.with_held(&[("left", 7.0)]), Err(ArmError::HeldOutside { .. })));
    assert!(matches!(arm.with_held(&[("left", f64::NAN)]), Err(ArmError::HeldOutside { .. })));
    assert!(matches!(robot.arm(&spec("base", "r")), Err(ArmError::MimicInChain { .. })));

    let moved = joint("lift", "revolute", "base", "r", &format!("{LIMIT}<mimic joint='arm'/>"))
        + &joint("arm", "revolute", "r", "l", LIMIT);
    let moved = self::robot("base l r", &moved).unwrap();
    assert!(matches!(moved.arm(&spec("r", "l")), Err(ArmError::MimicInChain { .. })));

    let circle = joint("a", "revolute", "base", "l", &format!("{LIMIT}<mimic joint='b'/>"))
        + &joint("b", "revolute", "base", "r", &format!("{LIMIT}<mimic joint='a'/>"));
    let error = self::robot("base l r", &circle).unwrap_err();
    assert!(matches!(error, UrdfError::BadMimic { .. }), "{error}");
    let lost = joint("a", "revolute", "base", "l", &format!("{LIMIT}<mimic joint='x'/>"));
    assert!(matches!(self::robot("base l", &lost), Err(UrdfError::BadMimic { .. })));
}

#[test]
fn shapes_are_read() {
    let text = "<robot name='r'><link name='a'>\
        <collision><origin xyz='1 2 3'/><geometry><box size='2 4 6'/></geometry></collision>\
        <visual><geometry><sphere radius='9'/></geometry></visual>\
        <collision><geometry><cylinder radius='1' length='4'/></geometry></collision>\
        <collision><geometry><sphere radius='3'/></geometry></collision>\
        <collision><geometry><mesh filename='package://x.stl' scale='1 1 2'/></geometry></collision>\
        </link></robot>";
    let robot = Robot::from_urdf_str(text).unwrap();
    let shapes = &robot.links()[0].collisions;
    assert_eq!(shapes.len(), 4);
    assert_eq!(shapes[0].geometry, Geometry::Box { half_extents: Vector3::new(1.0, 2.0, 3.0) });
    assert_eq!(shapes[0].origin.translation.vector, Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(shapes[1].geometry, Geometry::Cylinder { radius: 1.0, half_length: 2.0 });
    assert_eq!(shapes[2].geometry, Geometry::Sphere { radius: 3.0 });
    let mesh = Geometry::Mesh { uri: "package://x.stl".into(), scale: Vector3::new(1.0, 1.0, 2.0) };
    assert_eq!(shapes[3].geometry, mesh);
}

#[test]
fn fingerprint_names_the_kinematics() {
    let text = include_str!("../pr2.urdf");
    let of = |text: &str, side| {
        Robot::from_urdf_str(text).unwrap().arm(&ArmSpec::pr2(side)).unwrap().fingerprint()
    };
    let ours = of(text, Side::Right);
    assert_ne!(ours, of(text, Side::Left));
    let held = Robot::pr2().arm(&ArmSpec::pr2(Side::Right)).unwrap();
    assert_eq!(ours, held.with_held(&[("torso_lift_joint", 0.2)]).unwrap().fingerprint());
    // What does not move an arm does not change it.
    assert_eq!(ours, of(&text.replace("radius=\"0.0725\"", "radius=\"0.08\""), Side::Right));
    assert_eq!(ours, of(&text.replace("acceleration=\"8\"", "acceleration=\"9\""), Side::Right));
    for (from, to) in [
        ("0.321 0 0", "0.322 0 0"),
        ("velocity=\"3.078\"", "velocity=\"3.079\""),
        ("k_position=\"20\"", "k_position=\"21\""),
        ("soft_upper_limit=\"-0.15\"", "soft_upper_limit=\"-0.16\""),
        ("l_wrist_roll_joint", "left_wrist_roll_joint"),
        ("type=\"continuous\"", "type=\"fixed\""),
    ] {
        assert!(text.contains(from), "{from}");
        assert_ne!(ours, of(&text.replace(from, to), Side::Right), "{from} → {to}");
    }
    // Nor does the order of the file.
    let (first, rest) = text.split_once("  <link name=\"head_link\">").unwrap();
    let (head, rest) = rest.split_once("  </link>\n").unwrap();
    let moved = format!("{first}{rest}")
        .replace("</robot>", &format!("<link name=\"head_link\">{head}</link></robot>"));
    assert_eq!(ours, of(&moved, Side::Right));
}

/// The closed form knows the shape by its axes: the same arm described with other frames, signs
/// and zeros is recognised, and gives the same solutions.
#[test]
fn shape_is_recognised_in_other_frames() {
    let turned = |joint: &str,
                  kind: &str,
                  parent: &str,
                  child: &str,
                  xyz: &str,
                  rpy: &str,
                  axis: &str| {
        format!(
            "<joint name='{joint}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
             <origin xyz='{xyz}' rpy='{rpy}'/><axis xyz='{axis}'/>\
             <limit lower='-2.9' upper='2.9' effort='1' velocity='1'/></joint>"
        )
    };
    // Every axis is z of its own frame, as Denavit and Hartenberg have it, some turned round.
    let half = "1.5707963267948966";
    let joints = [
        turned("j1", "revolute", "l0", "l1", "0.3 0.2 0.1", "0.4 0.5 0.6", "0 0 1"),
        turned("j2", "revolute", "l1", "l2", "0.1 0 0", &format!("{half} 0 0"), "0 0 -1"),
        turned("j3", "revolute", "l2", "l3", "0 0 0", &format!("{half} 0 0.7"), "0 0 1"),
        turned("j4", "revolute", "l3", "l4", "0 0 0.4", &format!("{half} 0 0.3"), "0 0 1"),
        turned("j5", "revolute", "l4", "l5", "0 0 0", &format!("0 {half} 0"), "0 0 -1"),
        turned("j6", "revolute", "l5", "l6", "0 0 0.3", &format!("{half} 0 1"), "0 0 1"),
        turned("j7", "revolute", "l6", "l7", "0 0 0", &format!("0 {half} 0.2"), "0 0 1"),
        turned("j8", "fixed", "l7", "tip", "0.1 0.2 0.3", "1 2 3", "0 0 1"),
    ];
    let robot = robot("l0 l1 l2 l3 l4 l5 l6 l7 tip", &joints.concat()).unwrap();
    assert_eq!(robot.joints()[7].kind, JointKind::Fixed);
    let arm = robot.arm(&spec("l0", "tip")).unwrap();
    let pan = arm.ik_by(nullsweep_robot::RedundantJoint::ShoulderPan);
    let ik = [arm.ik(), pan.expect("recognised as an arm of the PR2's shape")];
    let mut out = Solutions::new();
    for ik in ik {
        for k in 0..500 {
            let q = JointVector::from_fn(|i| {
                if i < 7 { f64::from(k * (i as i32 + 3) % 57) / 10.0 - 2.8 } else { 0.0 }
            });
            let target = arm.tip_pose(&q);
            ik.solve(&target, q[ik.redundant_joint().unwrap()], &mut out);
            let mut nearest = f64::INFINITY;
            for solution in &out {
                let reached = arm.tip_pose(&solution.q);
                assert!((reached.to_homogeneous() - target.to_homogeneous()).amax() < 1e-9);
                let off = q.iter().zip(&solution.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                nearest = nearest.min(off);
            }
            assert!(nearest < 1e-5, "{nearest} {q:?}");
        }
    }
}

/// Damaged text ends in an error or a robot, never in a panic.
#[test]
fn damaged_text_does_not_panic() {
    let text = include_str!("../pr2.urdf");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut refused = 0;
    for _ in 0..400 {
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            match rng.random_range(0..4) {
                0 => bytes.truncate(at.max(1)),
                1 => bytes[at] = b"<>\"/-e 0\0"[rng.random_range(0..9)],
                2 => drop(bytes.drain(at..(at + rng.random_range(1..60)).min(bytes.len()))),
                _ => {
                    let end = (at + rng.random_range(1..300)).min(bytes.len());
                    let copy = bytes[at..end].to_vec();
                    bytes.splice(at..at, copy);
                }
            }
            if bytes.is_empty() {
                break;
            }
        }
        let text = String::from_utf8_lossy(&bytes);
        match Robot::from_urdf_str(&text) {
            Ok(robot) => {
                if let Ok(arm) = robot.arm(&ArmSpec::pr2(Side::Right)) {
                    assert!(arm.dof() <= 8);
                }
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                refused += 1;
            }
        }
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn an_arm_without_soft_limits_is_kept_off_its_hard_ones() {
    let robot = Robot::from_urdf_str(
        "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>\
         <joint name='hard' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>\
         <limit lower='-1' upper='2' velocity='1' effort='1'/></joint>\
         <joint name='soft' type='revolute'><parent link='b'/><child link='c'/><axis xyz='0 1 0'/>\
         <limit lower='-1' upper='2' velocity='1' effort='1'/>\
         <safety_controller soft_lower_limit='-0.9' soft_upper_limit='1.9' k_velocity='1'/></joint>\
         <joint name='short' type='prismatic'><parent link='c'/><child link='d'/>\
         <axis xyz='0 0 1'/><limit lower='0' upper='0.1' velocity='1' effort='1'/></joint></robot>",
    )
    .unwrap();
    let arm = robot.arm(&ArmSpec { base: "a".into(), tip: "d".into() }).unwrap();
    assert_eq!(arm.joints_without_soft_limits(), ["hard", "short"]);
    let wanted = [(-0.99, 1.99), (-0.9, 1.9), (0.001, 0.099)];
    for ((lower, upper), (low, high)) in arm.margined_limits().iter().zip(wanted) {
        assert!((lower - low).abs() < 1e-12 && (upper - high).abs() < 1e-12, "{lower} {upper}");
    }
    // The rule of planner and executor stays what the description says.
    assert_eq!(arm.braking_limits(0, 1.0), (-1.0, 2.0));
}
