//! The fast check against the exact one, on primitives and on meshes.

use rayon::prelude::*;

use super::*;

/// Fast and exact agree on every configuration; returns how many are free. The fast check may also
/// refuse what is nearer to a margin than its tolerance, but no draw here is.
fn agree(world: &World, configurations: &[JointVector], contact: ToolContact) -> usize {
    let free: Vec<bool> = configurations
        .par_iter()
        .map(|q| {
            let fast = world.is_free(q, contact);
            match world.exact().first_hit(q, contact) {
                Some(hit) => assert!(!fast, "passed {q:?} with {contact:?}, but {hit}"),
                None => assert!(fast, "refused {q:?} with {contact:?}"),
            }
            fast
        })
        .collect();
    free.into_iter().filter(|&f| f).count()
}

#[test]
fn pr2_fast_check_agrees_with_exact_on_random_configurations() {
    let (arm, _, _, world) = pr2_world(500);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let all: Vec<_> = (0..10_000).map(|_| random_configuration(&arm, &mut rng)).collect();
    let free = agree(&world, &all, ToolContact::Forbidden);
    assert!((500..9_500).contains(&free), "{free} of 10000 free: the test sees one side only");
}

#[test]
fn pr2_fast_check_agrees_with_exact_near_contact() {
    let (arm, tool, scan, world) = pr2_world(5_000);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let all: Vec<_> = (0..500).map(|_| near_wall(&arm, &tool, &scan, &mut rng)).collect();
    let touching = agree(&world, &all, ToolContact::Allowed);
    let apart = agree(&world, &all, ToolContact::Forbidden);
    assert!(touching > 50 && touching < 450, "{touching} of 500 free with contact");
    assert!(apart < touching, "{apart} free without contact, {touching} with");
}

#[test]
fn free_motions_are_free_all_along() {
    let (arm, tool, scan, world) = pr2_world(2000);
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    let (mut free, mut blocked) = (0, 0);
    for n in 0..60 {
        let contact = if n % 2 == 0 { ToolContact::Forbidden } else { ToolContact::Allowed };
        let mut draw = || {
            (0..1000)
                .map(|_| match n % 3 {
                    0 => near_wall(&arm, &tool, &scan, &mut rng),
                    _ => random_configuration(&arm, &mut rng),
                })
                .find(|q| world.is_free(q, contact))
                .unwrap()
        };
        let a = draw();
        let far = draw();
        // Short motions and long ones.
        let reach = if n % 4 < 2 { 0.1 } else { 1.0 };
        let b: JointVector = JointVector::from_fn(|j| a[j] + reach * (far[j] - a[j]));
        if !world.motion_free(&a, &b, contact) {
            blocked += 1;
            continue;
        }
        free += 1;
        for step in 0..=100 {
            let t = f64::from(step) / 100.0;
            let q: JointVector = JointVector::from_fn(|j| a[j] + t * (b[j] - a[j]));
            let hit = world.exact().first_hit(&q, contact);
            assert!(hit.is_none(), "motion {n} at {t}: {}", hit.unwrap());
        }
    }
    assert!(free >= 10 && blocked >= 5, "{free} free, {blocked} blocked");
}

#[test]
fn a_shape_of_size_0_is_told() {
    let joint = |i: usize| {
        format!(
            "<joint name='j{i}' type='revolute'><parent link='l{i}'/><child link='l{}'/>\
             <origin xyz='0 0 0.3'/><axis xyz='0 1 0'/>\
             <limit lower='-2' upper='2' effort='1' velocity='1'/></joint>",
            i + 1
        )
    };
    let text = format!(
        "<robot name='r'><link name='l0'><collision><geometry><box size='0 0 0'/></geometry>\
         </collision></link><link name='l1'/><link name='l2'/>{}{}</robot>",
        joint(0),
        joint(1)
    );
    let robot = Robot::from_urdf_str(&text).unwrap();
    let arm = robot.arm(&ArmSpec { base: "l0".into(), tip: "l2".into() }).unwrap();
    let world = World::new(&robot, &arm, &Tool::default(), &[], &[], &Options::default()).unwrap();
    assert_eq!(world.notes(), ["l0: 1 collision shape(s) of size 0 skipped"]);
}

#[test]
fn meshes_fast_check_agrees_with_exact() {
    let folder = tempfile::tempdir().unwrap();
    let robot = mesh_robot(folder.path());
    let arm = robot.arm(&ArmSpec { base: "l0".into(), tip: "l6".into() }).unwrap();
    let mut tool = Tool { centre: [0.3, 0.0, 0.0], ..Tool::default() };
    tool.thickness = 0.05;
    let mut options = Options::default();
    // Without the package's folder the error names link and package.
    let missing = World::new(&robot, &arm, &tool, &[], &[], &options).unwrap_err().to_string();
    assert!(missing.contains("l1") && missing.contains("blobs"), "{missing}");
    // With capsules it goes on and says so.
    options.fit_capsules = Some(0.05);
    let fitted = World::new(&robot, &arm, &tool, &[], &[], &options).unwrap();
    assert_eq!(fitted.notes().len(), 6, "{:?}", fitted.notes());

    options.fit_capsules = None;
    options.meshes = MeshPaths::of_packages([("blobs".into(), folder.path().into())].into());
    let block = folder.path().join("block.stl");
    write_blob(&block, Vector3::new(0.2, 0.3, 0.1), Vector3::new(-0.6, 0.0, 0.6), 77);
    let obstacle = Obstacle {
        name: "block".into(),
        shape: Geometry::Mesh { uri: block.display().to_string(), scale: Vector3::repeat(1.0) }
            .into(),
        pose: Isometry3::rotation(Vector3::new(0.1, 0.2, 0.3)),
        carries_robot: false,
    };
    let scan = wall(100, 2);
    let world = World::new(&robot, &arm, &tool, &scan, &[obstacle], &options).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let all: Vec<_> = (0..10_000).map(|_| random_configuration(&arm, &mut rng)).collect();
    let free = agree(&world, &all, ToolContact::Forbidden);
    assert!((300..9_700).contains(&free), "{free} of 10000 free");
    assert!(agree(&world, &all[..1000], ToolContact::Allowed) > 0);
}

#[test]
fn capsules_stand_in_for_the_meshes_of_other_arms() {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/coverage-tasks");
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    for (file, base, tip) in
        [("ur5.urdf", "base_link", "tool0"), ("panda.urdf", "panda_link0", "panda_link8")]
    {
        let robot = Robot::from_urdf_file(&data.join(file)).unwrap();
        let arm = robot.arm(&ArmSpec { base: base.into(), tip: tip.into() }).unwrap();
        let options = Options { fit_capsules: Some(0.05), ..Options::default() };
        let tool = Tool { centre: [0.0, 0.0, 0.03], approach: [0.0, 0.0, 1.0], ..Tool::default() };
        let world = World::new(&robot, &arm, &tool, &wall(500, 4), &[], &options).unwrap();
        assert!(world.notes().len() >= 7, "{:?}", world.notes());
        let mut rng = ChaCha8Rng::seed_from_u64(13);
        let all: Vec<_> = (0..500).map(|_| random_configuration(&arm, &mut rng)).collect();
        let free = agree(&world, &all, ToolContact::Forbidden);
        assert!((100..480).contains(&free), "{file}: {free} of 500 free");
    }
}
