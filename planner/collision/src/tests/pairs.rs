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
