//! Every file of the corpus, every made seed and some thousand mutants of each go through the very
//! functions that the fuzzer runs.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use nullsweep_inputs::mutant::mutant;
use nullsweep_inputs::{TARGETS, Target};

/// The longest that one input may take: a fuzzer's bound for what never ends.
const LONGEST: Duration = Duration::from_secs(10);

/// Says which input it was where one ends in a panic.
struct Told(String);

impl Drop for Told {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("the input: {}", self.0);
        }
    }
}

fn files(target: &Target) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = std::fs::read_dir(target.corpus()).into_iter().flatten();
    let mut paths: Vec<PathBuf> = folder.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), std::fs::read(path).expect("a file"))).collect()
}

fn run(target: &Target, what: String, bytes: &[u8]) -> bool {
    let told = Told(what);
    let start = Instant::now();
    let taken = (target.run)(bytes);
    assert!(start.elapsed() < LONGEST, "{} took {:?}", told.0, start.elapsed());
    taken
}

fn check(name: &str) {
    let target = Target::named(name).expect("a target");
    let made = (target.made)().into_iter().enumerate();
    let made = made.map(|(k, bytes)| (PathBuf::from(format!("sound, made {k}")), bytes));
    let seeds: Vec<_> = made.chain(files(target)).collect();
    assert!(!seeds.is_empty(), "{name} has no seed");
    let mut taken = 0;
    for (path, bytes) in &seeds {
        let what = path.display();
        let sound = path.file_name().is_some_and(|f| f.to_string_lossy().starts_with("sound"));
        assert!(run(target, what.to_string(), bytes) || !sound, "{what} is refused");
        for seed in 0..target.mutants {
            taken += u64::from(run(target, format!("{what}, mutant {seed}"), &mutant(bytes, seed)));
        }
    }
    let tried = seeds.len() as u64 * target.mutants;
    println!("{name}: {} seeds, {taken} of {tried} mutants taken", seeds.len());
    // A target that takes nothing, or all, looks at nothing.
    assert!(taken > 0 && taken < tried, "{taken} of {tried} mutants taken");
}

/// A test for each target, and a target for each test.
macro_rules! targets {
    ($($name:ident)*) => {
        $(#[test] fn $name() { check(stringify!($name)); })*

        #[test]
        fn each_target_has_a_test() {
            let names: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

targets! { plan wire urdf srdf recording scan poses tool regions gtsp mesh room register }

/// The fuzzer has a target for each, and corpora belong to targets.
#[test]
fn each_target_has_its_fuzz_target() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let fuzz = std::fs::read_to_string(root.join("fuzz/Cargo.toml")).expect("a manifest");
    for target in TARGETS {
        let source = root.join("fuzz/fuzz_targets").join(format!("{}.rs", target.name));
        let source = std::fs::read_to_string(source).expect("a fuzz target");
        assert!(source.contains(&format!("nullsweep_inputs::run(\"{}\", ", target.name)));
        assert!(fuzz.contains(&format!("name = \"{}\"", target.name)));
    }
    let corpus = std::fs::read_dir(root.join("tests/inputs/corpus")).expect("a folder");
    for folder in corpus {
        let name = folder.expect("a folder").file_name();
        assert!(TARGETS.iter().any(|target| name == target.name), "{name:?} is of no target");
    }
}
