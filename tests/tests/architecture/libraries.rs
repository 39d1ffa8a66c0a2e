//! Libraries of others stay in the rooms that the table gives them.

use crate::packages::{Package, package_of, packages};
use crate::tokens::{paths, tokens};
use crate::tree::{Offence, Tree};

/// Manifests and sources that name a library outside its rooms.
pub(crate) fn check(tree: &Tree, table: &[(&str, &[&str])]) -> Vec<Offence> {
    let packages = packages(tree);
    let mut offences = Vec::new();
    for package in &packages {
        for dependency in &package.dependencies {
            if let Some((name, rooms)) = table.iter().find(|(name, _)| *name == dependency.name)
                && !rooms.iter().any(|room| is_in(room, package, &packages))
            {
                let text = format!("{name} belongs to {}", rooms.join(", "));
                offences.push(Offence::new(&package.manifest_path(), dependency.line, text));
            }
        }
    }
    for (path, text) in tree.with_extension("rs") {
        let Some(package) = package_of(&packages, path) else { continue };
        let barred: Vec<(String, &[&str])> = table
            .iter()
            .filter(|(_, rooms)| !rooms.iter().any(|room| is_of(path, room, package)))
            .map(|&(name, rooms)| (name.replace('-', "_"), rooms))
            .collect();
        for named in paths(tokens(path, text)) {
            if (named.segments.len() > 1 || named.open)
                && let Some((name, rooms)) = barred.iter().find(|(n, _)| *n == named.segments[0])
            {
                let text = format!("{name} belongs to {}", rooms.join(", "));
                offences.push(Offence::new(path, named.line, text));
            }
        }
    }
    offences.dedup();
    offences
}

/// A room is one crate, or a folder of its sources; a crate in a folder inside it is another room.
fn is_in(room: &str, package: &Package, packages: &[Package]) -> bool {
    package_of(packages, &format!("{room}/")).is_some_and(|owner| owner.dir == package.dir)
}

/// Whether a source of a package is of a room.
fn is_of(path: &str, room: &str, package: &Package) -> bool {
    room == package.dir || path.starts_with(&format!("{room}/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(source: &str, dependency: &str) -> Vec<String> {
        let manifest = format!("[package]\nname = \"x\"\n[dependencies]\n{dependency}\n");
        let tree = Tree::of(&[
            ("x/Cargo.toml", &manifest),
            ("x/src/lib.rs", source),
            ("x/cli/Cargo.toml", "[package]\nname = \"y\"\n[dependencies]\nclap = \"4\"\n"),
            ("x/cli/src/main.rs", "use clap::Parser;"),
        ]);
        check(&tree, &[("clap", &["x/cli"])]).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_library_in_its_room_passes() {
        assert!(told("/// clap::Parser\nfn f(clap: u8) { g(clap) }", "serde = \"1\"").is_empty());
    }

    #[test]
    fn a_folder_of_sources_is_a_room() {
        let tree = Tree::of(&[
            ("x/Cargo.toml", "[package]\nname = \"x\"\n[dependencies]\nclap = \"4\"\n"),
            ("x/src/lib.rs", "mod top; use clap::Args;"),
            ("x/src/top/mod.rs", "use clap::Parser;"),
            ("x/src/topmost.rs", "use clap::Parser;"),
        ]);
        let offences = check(&tree, &[("clap", &["x/src/top"])]);
        let told: Vec<String> = offences.iter().map(ToString::to_string).collect();
        let [lib, topmost] =
            ["lib", "topmost"].map(|file| format!("x/src/{file}.rs:1: clap belongs to x/src/top"));
        assert_eq!(told, [lib, topmost]);
    }

    #[test]
    fn a_library_outside_its_room_is_told() {
        let manifest = "x/Cargo.toml:4: clap belongs to x/cli";
        assert_eq!(told("", "clap = \"4\""), [manifest]);
        assert_eq!(told("", "c = { package = \"clap\", version = \"4\" }"), [manifest]);
        let derive = told("struct A;\n#[derive(clap::ValueEnum)]\nenum B {}", "");
        assert_eq!(derive, ["x/src/lib.rs:2: clap belongs to x/cli"]);
        assert_eq!(told("use clap::{Args};", ""), ["x/src/lib.rs:1: clap belongs to x/cli"]);
    }
}
