//! The architecture, checked: what ARCHITECTURE.md says of crates, modules and sizes is read from
//! the sources. The tables are in `house.rs`; each rule is a function over a tree of texts, tried
//! on small trees beside it.
//!
//! What cannot be seen: methods and fields (they have no path), what macros make of their input,
//! and names that a glob of another crate brings in.

mod circles;
mod crates;
mod documents;
mod edges;
mod house;
mod libraries;
mod markdown;
mod modules;
mod names;
mod packages;
mod programs;
mod refusals;
mod roundings;
mod sizes;
mod storeys;
mod tokens;
mod tree;

use std::path::Path;
use std::sync::LazyLock;

use edges::{Edge, all_edges};
use tree::{Tree, expect_none};

/// The repository.
static TREE: LazyLock<Tree> = LazyLock::new(|| {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    Tree::load(&root)
});

/// Who names what in it.
static EDGES: LazyLock<Vec<Edge>> = LazyLock::new(|| all_edges(&TREE));

#[test]
fn crates_import_only_what_is_allowed() {
    let mut offences = crates::check(&TREE, house::CRATES);
    offences.extend(crates::check_strangers(&TREE, house::STRANGERS));
    expect_none(offences, "Strike the dependency, or allow it in house.rs: CRATES.");
}

#[test]
fn no_circle_of_files() {
    let what_to_do = "Move what both need into a file of its own below them. A facade that also \
                      defines what its children need is part of the circle.";
    expect_none(circles::check(&EDGES), what_to_do);
}

#[test]
fn no_circle_of_modules() {
    let packages = packages::packages(&TREE);
    let sources: Vec<String> = packages.iter().map(|p| format!("{}/src", p.dir)).collect();
    let offences = circles::check(&storeys::of_modules(&EDGES, &sources));
    expect_none(offences, "Move what both modules need into one below them.");
}

#[test]
fn no_upward_import() {
    let offences = storeys::check(&TREE, &EDGES, house::STOREYS);
    expect_none(offences, "Move the item down, or give the module its place in house.rs: STOREYS.");
}

#[test]
fn libraries_stay_in_their_rooms() {
    let offences = libraries::check(&TREE, house::ROOMS);
    expect_none(offences, "Let the crate whose room it is do it, or see house.rs: ROOMS.");
}

#[test]
fn what_computes_plans_rounds_by_libm() {
    let offences = roundings::check(&TREE, house::ROUNDED);
    expect_none(offences, "Call the function of `libm`; four at once are in robot/src/lanes.rs.");
}

#[test]
fn verify_stands_alone() {
    let offences = storeys::check_apart(&TREE, &EDGES, house::APART);
    expect_none(offences, "The last gate shares no code with the search: see house.rs, APART.");
}

#[test]
fn every_refusal_is_tested() {
    let offences = refusals::check(&TREE, house::REFUSALS, "tests/tests/architecture/");
    expect_none(offences, "Write a test that provokes it and names it as Enum::Variant.");
}

#[test]
fn files_and_functions_are_short() {
    let what_to_do = "Take out a part that has a name of its own; parameters that go together \
                      are a struct.";
    expect_none(sizes::check(&TREE), what_to_do);
}

#[test]
fn documents_name_what_exists() {
    let offences = documents::check(&TREE, house::PROGRAMS);
    expect_none(offences, "Mend the document.");
}

#[test]
fn every_page_is_a_chapter_of_the_book() {
    let offences = documents::check_book(&TREE, "docs/SUMMARY.md");
    expect_none(offences, "Name it in the summary.");
}
