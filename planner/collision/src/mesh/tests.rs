use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::pieces::pieces;
use super::soup::Soup;
use super::*;

/// The triangles of a box.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Point3<f64>> {
    let corner =
        |n: usize| Point3::from([0, 1, 2].map(|i| if n >> i & 1 == 0 { low[i] } else { high[i] }));
    [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        .iter()
        .flat_map(|&[a, b, c, d]| [a, b, c, a, c, d].map(corner))
        .collect()
}

/// An elbow of two boxes: a quarter of its hull is empty.
fn elbow() -> Soup {
    let mut corners = cuboid([0.0, -0.05, -0.05], [0.4, 0.05, 0.05]);
    corners.extend(cuboid([0.0, -0.05, 0.05], [0.1, 0.05, 0.3]));
    Soup::of(corners)
}

/// A ring of blocks about z, as a flange is.
fn ring() -> Soup {
    let mut corners = Vec::new();
    for k in 0..12 {
        let (sine, cosine) = libm::sincos(std::f64::consts::TAU * f64::from(k) / 12.0);
        let block = cuboid([0.1, -0.03, -0.02], [0.14, 0.03, 0.02]);
        let turn =
            |p: Point3<f64>| Point3::new(cosine * p.x - sine * p.y, sine * p.x + cosine * p.y, p.z);
        corners.extend(block.into_iter().map(turn));
    }
    Soup::of(corners)
}

/// A blob of many faces.
fn blob(count: usize) -> Soup {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut unit = || rng.random_range(-1.0..1.0f64);
    let points = (0..count).map(|_| {
        let v = Vector3::new(unit(), unit(), unit()).normalize();
        Point3::new(0.12 * v.x, 0.05 * v.y, 0.07 * v.z)
    });
    Soup::of(points)
}

fn holds(hull: &Hull, p: &Point3<f64>) -> bool {
    hull.planes.iter().all(|(n, offset)| n.dot(&p.coords) <= offset + 1e-9)
}

#[test]
fn the_pieces_hold_every_place_of_the_mesh() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for mesh in [elbow(), ring(), blob(900)] {
        let hulls: Vec<Hull> =
            pieces(mesh.clone()).iter().map(|points| Hull::about(points).unwrap()).collect();
        for _ in 0..20_000 {
            let [a, b, c] =
                mesh.triangles[rng.random_range(0..mesh.triangles.len())].map(|i| mesh.vertices[i]);
            let (u, v): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p = a + u * (b - a) + v * (c - a);
            assert!(hulls.iter().any(|hull| holds(hull, &p)), "{p} is in none of {}", hulls.len());
        }
    }
}

#[test]
fn the_inside_of_a_closed_mesh_is_held_too() {
    let hulls: Vec<Hull> =
        pieces(elbow()).iter().map(|points| Hull::about(points).unwrap()).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(10);
    for _ in 0..20_000 {
        let mut at = |low: f64, high: f64| rng.random_range(low..high);
        let along = Point3::new(at(0.0, 0.4), at(-0.05, 0.05), at(-0.05, 0.05));
        let up = Point3::new(at(0.0, 0.1), at(-0.05, 0.05), at(0.05, 0.3));
        for p in [along, up] {
            assert!(hulls.iter().any(|hull| holds(hull, &p)), "{p}");
        }
    }
}

/// How far the centre line of a bent tube is from its axis, and its wall from that line. \[m\]
const BEND: [f64; 2] = [0.25, 0.06];
/// Sides of its cross-section, and steps along it.
const SIDES: usize = 24;
const STEPS: usize = 40;

/// A place of a tube that is bent by 270° and stands aslant, by turn along it, turn about its middle
/// and distance from that. \[rad\], \[m\]
fn in_tube(along: f64, about: f64, out: f64) -> Point3<f64> {
    let off = BEND[0] + out * libm::cos(about);
    let p = Point3::new(off * libm::cos(along), off * libm::sin(along), out * libm::sin(about));
    nalgebra::Rotation3::from_euler_angles(0.7, 0.4, 0.3) * p
}

/// The tube's faces, with or without those at its ends.
fn tube(has_ends: bool) -> Soup {
    let ring = |i: usize| 1.5 * std::f64::consts::PI * i as f64 / STEPS as f64;
    let about = |j: usize| std::f64::consts::TAU * (j % SIDES) as f64 / SIDES as f64;
    let at = |i: usize, j: usize| in_tube(ring(i), about(j), BEND[1]);
    let mut corners = Vec::new();
    for j in 0..SIDES {
        for i in 0..STEPS {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            corners.extend([a, b, c, a, c, d]);
        }
        for end in [0, STEPS].into_iter().filter(|_| has_ends) {
            corners.extend([at(end, j), at(end, j + 1), in_tube(ring(end), 0.0, 0.0)]);
        }
    }
    Soup::of(corners)
}

fn hulls_of(mesh: Soup) -> Vec<Hull> {
    pieces(mesh).iter().map(|points| Hull::about(points).expect("not flat")).collect()
}

#[test]
fn the_inside_of_a_bent_tube_is_held_with_and_without_its_ends() {
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    for has_ends in [true, false] {
        let hulls = hulls_of(tube(has_ends));
        assert!(hulls.len() > 3, "{}", hulls.len());
        for _ in 0..20_000 {
            let along = rng.random_range(0.0..1.5 * std::f64::consts::PI);
            let about = rng.random_range(0.0..std::f64::consts::TAU);
            // Within the flat faces, which lie inside of the round wall.
            let p = in_tube(along, about, 0.97 * BEND[1] * rng.random_range(0.0..1.0f64).sqrt());
            assert!(hulls.iter().any(|hull| holds(hull, &p)), "{p}, ends: {has_ends}");
        }
    }
}

/// Cells of a solid, and the faces between what is filled and what is not; without those on top if
/// it is open.
fn blocks(seed: u64, is_open: bool) -> (Vec<[usize; 3]>, Soup) {
    const SIDE: f64 = 0.1;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut filled = vec![[1usize, 1, 1]];
    while filled.len() < 12 {
        let mut next = filled[rng.random_range(0..filled.len())];
        let axis = rng.random_range(0..3);
        next[axis] =
            if rng.random_range(0..2) == 0 { next[axis] + 1 } else { next[axis].max(1) - 1 };
        if next[axis] < 4 && !filled.contains(&next) {
            filled.push(next);
        }
    }
    let top = filled.iter().map(|cell| cell[2]).max();
    let mut corners = Vec::new();
    for cell in &filled {
        let low = cell.map(|i| SIDE * i as f64);
        let faces = cuboid(low, cell.map(|i| SIDE * (i + 1) as f64));
        for (k, face) in faces.chunks_exact(6).enumerate() {
            // In the order of `cuboid`: along z, y, x, low before high.
            let axis = 2 - k / 2;
            let beside = if k % 2 == 1 { Some(cell[axis] + 1) } else { cell[axis].checked_sub(1) };
            let mut other = *cell;
            let covered = beside.is_some_and(|at| {
                other[axis] = at;
                filled.contains(&other)
            });
            let is_opening = is_open && k == 1 && Some(cell[2]) == top;
            if !covered && !is_opening {
                corners.extend_from_slice(face);
            }
        }
    }
    // Neighbouring cells have the same corners, to the bit.
    let round = |p: Point3<f64>| p.map(|x| (x / SIDE).round() * SIDE);
    (filled, Soup::of(corners.into_iter().map(round)))
}

#[test]
fn the_inside_is_held_however_often_it_was_cut_along_all_three_axes() {
    let mut rng = ChaCha8Rng::seed_from_u64(15);
    for seed in 0..12 {
        for is_open in [false, true] {
            let (filled, mesh) = blocks(seed, is_open);
            let hulls = hulls_of(mesh);
            for _ in 0..5_000 {
                let cell = filled[rng.random_range(0..filled.len())];
                let p = cell.map(|i| 0.1 * (i as f64 + rng.random_range(0.0..1.0)));
                let p = Point3::from(p);
                assert!(hulls.iter().any(|hull| holds(hull, &p)), "{p} of {seed}, open: {is_open}");
            }
        }
    }
}

#[test]
fn what_is_hollow_is_cut_and_what_is_not_stays_whole() {
    let elbow = pieces(elbow());
    assert!(elbow.len() > 1 && elbow.len() <= 4, "{}", elbow.len());
    // In the corner, 5 cm from either leg: in the hull of the whole, in none of the pieces.
    let free = Point3::new(0.15, 0.0, 0.1);
    assert!(elbow.iter().all(|points| !holds(&Hull::about(points).unwrap(), &free)));
    let whole: Vec<_> = elbow.concat();
    assert!(holds(&Hull::new(&whole).unwrap(), &free));
    let mut notched = cuboid([0.0; 3], [0.4, 0.1, 0.1]);
    notched.extend(cuboid([0.1, 0.04, -0.02], [0.102, 0.06, 0.0]));
    assert_eq!(pieces(Soup::of(notched)).len(), 1, "a rivet is not worth a cut");
}

#[test]
fn a_simplified_hull_has_few_planes_and_is_little_larger() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let blob = blob(900);
    let (exact, simple) =
        (Hull::new(&blob.vertices).unwrap(), Hull::about(&blob.vertices).unwrap());
    assert!(exact.planes.len() > 200, "{}", exact.planes.len());
    assert!(simple.planes.len() <= 64, "{}", simple.planes.len());
    let farthest = simple
        .corners()
        .map(|v| exact.planes.iter().map(|(n, o)| n.dot(&v) - o).fold(f64::MIN, f64::max))
        .fold(0.0, f64::max);
    assert!(farthest < 0.006, "{farthest} m");
    for _ in 0..2000 {
        let p = blob.vertices[rng.random_range(0..blob.vertices.len())];
        assert!(simple.planes.iter().all(|(n, offset)| n.dot(&p.coords) <= *offset));
    }
    // A box stays what it is.
    let cuboid = cuboid([0.0; 3], [0.1, 0.2, 0.3]);
    assert_eq!(Hull::about(&cuboid).unwrap().corners().count(), 8);
}

#[test]
fn uris_lead_to_files() {
    let packages = [("arm".to_string(), PathBuf::from("share/arm"))].into();
    let paths = MeshPaths { relative_to: "urdf".into(), ..MeshPaths::of_packages(packages) };
    let path = |uri| paths.resolve(uri).map(|found| found.path);
    assert_eq!(path("package://arm/a/b.stl").unwrap(), Path::new("share/arm/a/b.stl"));
    assert_eq!(path("file://x/a.stl").unwrap(), Path::new("x/a.stl"));
    assert_eq!(path("a.stl").unwrap(), Path::new("urdf/a.stl"));
    let unknown = path("package://leg/a.stl").unwrap_err().to_string();
    assert!(unknown.contains("`leg`"), "{unknown}");
    assert!(matches!(path("http://x/a.stl"), Err(MeshError::Scheme { .. })));
}

#[test]
fn packages_are_found_beside_the_urdf_and_what_was_looked_at_is_told() {
    let root = tempfile::tempdir().unwrap();
    let urdf = root.path().join("my_arm/urdf");
    for folder in ["my_arm/urdf", "my_arm/meshes", "other/meshes"] {
        std::fs::create_dir_all(root.path().join(folder)).unwrap();
    }
    for file in ["my_arm/meshes/a.stl", "other/meshes/b.stl"] {
        std::fs::write(root.path().join(file), "").unwrap();
    }
    let paths = MeshPaths::of_machine(&urdf, BTreeMap::new());
    let found = paths.resolve("package://my_arm/meshes/a.stl").unwrap();
    assert!(found.path.ends_with("my_arm/meshes/a.stl"));
    assert!(found.told.unwrap().contains("package my_arm is "));
    assert!(
        paths.resolve("package://other/meshes/b.stl").unwrap().path.ends_with("other/meshes/b.stl")
    );
    // A package of that name without the file is another one.
    let missing = paths.resolve("package://other/meshes/c.stl").map(|found| found.path);
    let text = missing.unwrap_err().to_string();
    for place in ["my_arm/urdf", "AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH", "Python"] {
        assert!(text.contains(place), "{text}");
    }
}

/// Real links' meshes, where `pip install --no-deps example-robot-data` put them.
#[test]
fn real_links_are_held_by_few_pieces_of_few_planes() {
    let paths = MeshPaths::of_machine(Path::new(""), BTreeMap::new());
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let links = [
        (
            "ur_description/meshes/ur5",
            ["base", "shoulder", "upperarm", "forearm", "wrist1", "wrist3"],
        ),
        ("panda_description/meshes", ["link0", "link2", "link4", "link5", "link7", "hand"]),
    ];
    for (folder, names) in links {
        for name in names {
            let uri = format!("package://example-robot-data/robots/{folder}/collision/{name}.stl");
            let Ok(found) = paths.resolve(&uri) else {
                println!(
                    "skipped: {uri} is not installed; `pip install --no-deps example-robot-data` \
                     in the active environment gets it"
                );
                return;
            };
            let mesh = stl::read(&found.path, &Vector3::repeat(1.0)).unwrap();
            let begun = std::time::Instant::now();
            let hulls = paths.hulls(&found, &Vector3::repeat(1.0)).unwrap();
            let planes: Vec<_> = hulls.iter().map(|hull| hull.planes.len()).collect();
            println!(
                "{name}: {} triangles, planes {planes:?}, {:.1?}",
                mesh.triangles.len(),
                begun.elapsed()
            );
            assert!(planes.iter().all(|count| *count <= 64), "{name}: {planes:?}");
            for _ in 0..5000 {
                let [a, b, c] = mesh.triangles[rng.random_range(0..mesh.triangles.len())]
                    .map(|i| mesh.vertices[i]);
                let (u, v): (f64, f64) = (rng.random_range(0.0..0.5), rng.random_range(0.0..0.5));
                let p = a + u * (b - a) + v * (c - a);
                assert!(hulls.iter().any(|hull| holds(hull, &p)), "{name}: {p}");
            }
        }
    }
}
