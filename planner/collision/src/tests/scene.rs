//! What the checks are built from.

use super::*;
use crate::frame::Frame;

#[test]
fn bodies_follow_the_robot_crate() {
    let (robot, arm, tool) = pr2();
    let world = World::new(&robot, &arm, &tool, &[], &[], &Options::default()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut links = vec![Isometry3::identity(); robot.links().len()];
    for _ in 0..200 {
        let q = random_configuration(&arm, &mut rng);
        arm.link_poses(&q, &mut links);
        let poses = world.bodies.poses(&q);
        for (pose, (body, frame)) in links.iter().zip(&world.bodies.links) {
            let ours = body.map_or(*frame, |b| poses[b].then(frame));
            let theirs = Frame::from(pose);
            assert!((ours.translation - theirs.translation).norm() < 1e-12);
            assert!((ours.rotation - theirs.rotation).norm() < 1e-12);
        }
        let tip = poses[world.bodies.tip_body].then(&world.bodies.tip).translation;
        assert!((tip - arm.tip_pose(&q).translation.vector).norm() < 1e-12);
    }
}

#[test]
fn not_a_number_is_never_free() {
    let (arm, _, _, world) = pr2_world(100);
    for bad in [f64::NAN, f64::INFINITY] {
        let mut q = arm.home();
        q[3] = bad;
        assert!(!world.is_free(&q, ToolContact::Forbidden));
        assert!(!world.exact().is_free(&q, ToolContact::Forbidden));
        assert!(!world.motion_free(&arm.home(), &q, ToolContact::Forbidden));
    }
    let (robot, arm, tool) = pr2();
    let scan = [Point3::new(0.0, f64::NAN, 0.0)];
    let world = World::new(&robot, &arm, &tool, &scan, &[], &Options::default());
    assert!(matches!(world, Err(CollisionError::NotFinite { index: 0 })));
}

#[test]
fn the_floor_carries_the_robot_but_stops_the_arm() {
    let (robot, arm, tool) = pr2();
    let floor = Obstacle::floor(Isometry3::identity());
    let world = World::new(&robot, &arm, &tool, &[], &[floor], &Options::default()).unwrap();
    assert_eq!(world.stance_hit(), None);
    let raised = Obstacle::floor(Isometry3::translation(0.0, 0.0, 3.0));
    let world = World::new(&robot, &arm, &tool, &[], &[raised], &Options::default()).unwrap();
    let hit = world.why_not(&arm.home(), ToolContact::Allowed).unwrap();
    assert_eq!(hit.with, With::Obstacle("floor".into()));
    assert!(!world.is_free(&arm.home(), ToolContact::Allowed));
    // A point inside the base is a matter of the stance.
    let scan = [Point3::new(0.0, 0.0, 0.2)];
    let world = World::new(&robot, &arm, &tool, &scan, &[], &Options::default()).unwrap();
    let hit = world.stance_hit().unwrap();
    assert!(hit.link == "base_link" && hit.distance < 0.0, "{hit}");
}

#[test]
fn the_exact_check_alone_says_what_the_worlds_says() {
    let (robot, arm, tool) = pr2();
    let (scan, options) = (wall(300, 3), Options::default());
    let obstacles = [table(), Obstacle::floor(Isometry3::identity())];
    let alone = Exact::new(&robot, &arm, &tool, &scan, &obstacles, &options).unwrap();
    let world = World::new(&robot, &arm, &tool, &scan, &obstacles, &options).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let mut free = 0;
    for _ in 0..300 {
        let q = random_configuration(&arm, &mut rng);
        let hit = alone.first_hit(&q, ToolContact::Forbidden);
        assert_eq!(hit, world.exact().first_hit(&q, ToolContact::Forbidden));
        assert_eq!(alone.is_free(&q, ToolContact::Forbidden), hit.is_none());
        free += usize::from(hit.is_none());
    }
    assert!((10..290).contains(&free), "{free} of 300 free");
    assert_eq!(alone.stance_hit(), None);
    let inside = [Point3::new(0.0, 0.0, 0.2)];
    let alone = Exact::new(&robot, &arm, &tool, &inside, &[], &options).unwrap();
    assert_eq!(alone.stance_hit().unwrap().with, With::ScanPoint(inside[0]));
}

#[test]
fn an_obstacle_may_have_any_shape_that_a_urdf_has() {
    let (robot, arm, tool) = pr2();
    let tip = arm.tip_pose(&arm.home());
    let folder = tempfile::tempdir().unwrap();
    write_blob(&folder.path().join("blob.stl"), Vector3::repeat(0.1), Vector3::zeros(), 5);
    let meshes = MeshPaths::of_machine(folder.path(), [].into());
    let options = Options { meshes, ..Options::default() };
    for shape in [
        Geometry::Box { half_extents: Vector3::repeat(0.1) },
        Geometry::Sphere { radius: 0.1 },
        Geometry::Cylinder { radius: 0.1, half_length: 0.1 },
        Geometry::Capsule { radius: 0.1, half_length: 0.1 },
        Geometry::Mesh { uri: "blob.stl".into(), scale: Vector3::repeat(1.0) },
    ] {
        let text = format!("{shape:?}");
        let obstacle =
            Obstacle { name: "thing".into(), shape: shape.into(), pose: tip, carries_robot: false };
        let world = World::new(&robot, &arm, &tool, &[], &[obstacle], &options).unwrap();
        let hit = world.why_not(&arm.home(), ToolContact::Allowed).unwrap();
        assert_eq!(hit.with, With::Obstacle("thing".into()), "{text}");
        assert!(!world.is_free(&arm.home(), ToolContact::Allowed), "{text}");
    }
    // A cylinder lies along z of its pose: 1 m long, it is far from the tip across, not along.
    let rod = |across: f64, along: f64| {
        let shape = Geometry::Cylinder { radius: 0.02, half_length: 0.5 }.into();
        let pose = Isometry3::translation(across, 0.0, along) * Isometry3::from(tip.translation);
        let rod = Obstacle { name: "rod".into(), shape, pose, carries_robot: false };
        let world = World::new(&robot, &arm, &tool, &[], &[rod], &options).unwrap();
        let free = world.is_free(&arm.home(), ToolContact::Allowed);
        assert_eq!(free, world.exact().is_free(&arm.home(), ToolContact::Allowed));
        free
    };
    assert!(!rod(0.0, 0.45) && rod(0.45, 0.0));
    let missing = Obstacle {
        name: "gone".into(),
        shape: Geometry::Mesh { uri: "gone.stl".into(), scale: Vector3::repeat(1.0) }.into(),
        pose: tip,
        carries_robot: false,
    };
    let error = Exact::new(&robot, &arm, &tool, &[], &[missing], &options).unwrap_err();
    assert!(matches!(error, CollisionError::ObstacleMesh { obstacle, .. } if obstacle == "gone"));
}

#[test]
fn a_tool_that_cannot_be_is_refused_by_both_checks() {
    let (robot, arm, tool) = pr2();
    type Spoil = fn(&mut Tool);
    let spoil: [(&str, Spoil); 4] = [
        ("thickness is -0.03 m", |t| t.thickness = -0.03),
        ("width is NaN m", |t| t.width = f64::NAN),
        ("approach is [0.0, 0.0, 0.0]", |t| t.approach = [0.0; 3]),
        ("are parallel", |t| t.across = t.approach),
    ];
    for (says, spoil) in spoil {
        let mut tool = tool.clone();
        spoil(&mut tool);
        let options = Options::default();
        let world = World::new(&robot, &arm, &tool, &[], &[], &options).map(|_| ());
        let exact = Exact::new(&robot, &arm, &tool, &[], &[], &options).map(|_| ());
        for refused in [world, exact] {
            let said = refused.expect_err(says).to_string();
            assert!(said.contains(says), "{said}");
        }
    }
}

/// A link that turns about the vertical and hangs below the floor by its own shape.
#[test]
fn what_meets_the_floor_in_every_posture_is_excused_by_name_and_nothing_else() {
    let robot = Robot::from_urdf_str(
        "<robot name='low'><link name='base'/>\
         <link name='turret'><collision><origin xyz='0 0 0.02'/><geometry>\
         <cylinder radius='0.1' length='0.1'/></geometry></collision></link>\
         <link name='boom'><collision><origin xyz='0.2 0 0'/><geometry>\
         <box size='0.4 0.04 0.04'/></geometry></collision></link>\
         <joint name='turn' type='revolute'><parent link='base'/><child link='turret'/>\
         <axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='1' effort='1'/></joint>\
         <joint name='lift' type='revolute'><parent link='turret'/><child link='boom'/>\
         <origin xyz='0 0 0.2'/><axis xyz='0 -1 0'/>\
         <limit lower='-1.5' upper='1.5' velocity='1' effort='1'/></joint></robot>",
    )
    .unwrap();
    let arm = robot.arm(&ArmSpec { base: "base".into(), tip: "boom".into() }).unwrap();
    let tool = Tool { centre: [0.4, 0.0, 0.0], ..Tool::default() };
    let floor = [Obstacle::floor(Isometry3::identity())];
    let world = World::new(&robot, &arm, &tool, &[], &floor, &Options::default()).unwrap();
    let told: Vec<_> = world.notes().iter().filter(|note| note.contains("every posture")).collect();
    assert!(told.len() == 1 && told[0].starts_with("turret "), "{told:?}");
    let at = |lift: f64| {
        let mut q = JointVector::ZERO;
        q[1] = lift;
        let free = world.is_free(&q, ToolContact::Forbidden);
        assert_eq!(free, world.exact().is_free(&q, ToolContact::Forbidden), "{lift}");
        free
    };
    assert!(
        at(0.5),
        "only the turret is low: {:?}",
        world.why_not(&arm.home(), ToolContact::Forbidden)
    );
    assert!(!at(-1.0), "the boom is in the floor");
    let excused = world.exact().grounded_links();
    assert!(excused.iter().eq([&["turret".to_owned(), "floor".to_owned()]]), "{excused:?}");
    // Nor is it what there is least room to: the boom's lower side is.
    let room = world.exact().clearance(&JointVector::ZERO, 1.0);
    let least = room.arm.min(room.hand);
    assert!((least - 0.18).abs() < 1e-9, "{room:?}");
}
