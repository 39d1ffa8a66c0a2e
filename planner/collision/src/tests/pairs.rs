//! Which pairs are checked, and why the others are not.

use super::*;

#[test]
fn every_pair_is_checked_or_excluded_with_a_reason() {
    let (arm, _, _, world) = pr2_world(0);
    let scene = world.exact().scene();
    let name = |i: usize| scene.parts[i].name.as_str();
    for b in 0..scene.parts.len() {
        for a in 0..b {
            if !scene.moves[a] && !scene.moves[b] {
                continue;
            }
            let checked = scene.pairs.checked.contains(&(a, b));
            let shape = |i: usize| (0..i).filter(|&k| name(k) == name(i)).count();
            let excluded = world.excluded().iter().any(|e| {
                (e.first.as_str(), e.second.as_str()) == (name(a), name(b))
                    && e.shapes.is_none_or(|s| s == (shape(a), shape(b)))
            });
            let body = |i: usize| world.bodies.carrier(scene.parts[i].link).0;
            let rigid = body(a) == body(b);
            let times = u8::from(checked) + u8::from(excluded) + u8::from(rigid);
            assert_eq!(times, 1, "{} and {}", name(a), name(b));
        }
    }
    assert!(arm.home().iter().all(|x| x.is_finite()));
    assert!(
        world.is_free(&arm.home(), ToolContact::Forbidden),
        "{}",
        world.why_not(&arm.home(), ToolContact::Forbidden).unwrap()
    );
}

/// The reason for which two names are not checked; they stand in the order of the URDF, but for an
/// SRDF's.
fn reason(world: &World, first: &str, second: &str) -> Option<Reason> {
    let found = world.excluded().iter().find(|e| e.first == first && e.second == second);
    found.map(|e| e.reason)
}

#[test]
fn the_pr2s_neighbours_are_left_out_each_for_its_reason() {
    let (_, _, _, world) = pr2_world(0);
    let reason = |first, second| reason(&world, first, second);
    // The elbow's joint joins both.
    assert_eq!(reason("r_upper_arm_link", "r_elbow_flex_link"), Some(Reason::Adjacent));
    // Forearm and its roll link are one weld, and the elbow touches it.
    assert_eq!(reason("r_elbow_flex_link", "r_forearm_link"), Some(Reason::Welded));
    // The palm is two joints away, but its shape reaches into the forearm's end all the time.
    assert_eq!(reason("r_forearm_link", "r_gripper_palm_link"), Some(Reason::AlwaysTouching));
    let of_palm = world.excluded().iter().find(|e| e.second == "r_gripper_palm_link").unwrap();
    assert_eq!(of_palm.shapes, Some((3, 0)), "only this shape of the forearm");
    // What can come apart is checked.
    assert_eq!(reason("r_upper_arm_link", "r_forearm_link"), None);
    assert_eq!(reason("base_link", "r_forearm_link"), None);
}

/// A column, a link without a shape that turns above it, a bar that turns about the same axis, a
/// plate welded to the bar, and a hand that turns at the bar's end. The plate stands `before` the
/// hand's axis; the shapes of column and bar stand `out` of theirs. \[m\]
fn small_robot(before: f64, out: f64) -> World {
    let link = |name: &str, place: &str, shape: &str| {
        format!(
            "<link name='{name}'><collision><origin xyz='{place}'/><geometry>{shape}</geometry>\
             </collision></link>"
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, place: &str| {
        format!(
            "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>\
             <origin xyz='{place}'/><axis xyz='0 0 1'/><limit lower='-2' upper='2' velocity='1' \
             effort='1'/></joint>"
        )
    };
    let xml = [
        "<robot name='small'>".to_owned(),
        link("column", &format!("{out} 0 0.2"), "<cylinder radius='0.05' length='0.4'/>"),
        "<link name='turn'/>".to_owned(),
        link("bar", &format!("{out} 0 0"), "<box size='0.1 0.1 0.1'/>"),
        link("plate", "0 0 0", "<box size='0.02 0.2 0.02'/>"),
        link("hand", "0.05 0 0", "<box size='0.1 0.04 0.04'/>"),
        joint("j0", "revolute", "column", "turn", "0 0 0.44"),
        joint("j1", "revolute", "turn", "bar", "0 0 0"),
        joint("weld", "fixed", "bar", "plate", &format!("{} 0 0", 0.4 - before)),
        joint("j2", "revolute", "bar", "hand", "0.4 0 0"),
        "</robot>".to_owned(),
    ]
    .concat();
    let robot = Robot::from_urdf_str(&xml).unwrap();
    let arm = robot.arm(&ArmSpec { base: "column".into(), tip: "hand".into() }).unwrap();
    World::new(&robot, &arm, &Tool::default(), &[], &[], &Options::default()).unwrap()
}

#[test]
fn welded_neighbours_are_left_out_only_where_they_touch_at_home() {
    let touching = small_robot(0.0, 0.0);
    assert_eq!(reason(&touching, "plate", "hand"), Some(Reason::Welded));
    assert_eq!(reason(&touching, "bar", "hand"), Some(Reason::Adjacent));
    let apart = small_robot(0.1, 0.0);
    assert_eq!(reason(&apart, "plate", "hand"), None);
    assert_eq!(reason(&apart, "bar", "hand"), Some(Reason::Adjacent), "however far apart");
}

#[test]
fn what_touches_at_home_but_not_always_is_checked() {
    let on_the_axis = small_robot(0.0, 0.0);
    assert_eq!(reason(&on_the_axis, "column", "bar"), Some(Reason::AlwaysTouching));
    let beside_it = small_robot(0.0, 0.2);
    assert_eq!(reason(&beside_it, "column", "bar"), None);
    let hit = beside_it.why_not(&JointVector::ZERO, ToolContact::Forbidden).unwrap();
    assert_eq!((hit.link.as_str(), hit.with), ("column", With::Link("bar".into())));
}

#[test]
fn srdf_pairs_take_the_place_of_sampling() {
    let (robot, arm, tool) = pr2();
    let mut srdf = tempfile::NamedTempFile::new().unwrap();
    write!(
        srdf,
        "<robot name='pr2'><disable_collisions link1='r_forearm_link' link2='base_link'/></robot>"
    )
    .unwrap();
    let options = Options { srdf: Some(srdf.path().into()), ..Options::default() };
    let world = World::new(&robot, &arm, &tool, &[], &[], &options).unwrap();
    let by_srdf: Vec<_> = world.excluded().iter().filter(|e| e.reason == Reason::Srdf).collect();
    assert_eq!(by_srdf.len(), 1);
    assert_eq!(
        (by_srdf[0].first.as_str(), by_srdf[0].second.as_str()),
        ("base_link", "r_forearm_link")
    );
}
