//! Inside a crate: which module may import which, and which must not know each other.

use std::collections::{BTreeMap, BTreeSet};

use crate::circles;
use crate::edges::Edge;
use crate::house::Storeys;
use crate::tree::{Offence, Tree, some_of};

impl Storeys {
    /// Every module with all that it may import.
    fn rows(&self) -> BTreeMap<&'static str, BTreeSet<&'static str>> {
        match self {
            Self::Table(rows) => {
                rows.iter().map(|&(module, may)| (module, may.iter().copied().collect())).collect()
            }
            Self::Ladder(rungs) => {
                let below = |i: usize| rungs[..i].iter().copied().collect();
                rungs.iter().enumerate().map(|(i, &module)| (module, below(i))).collect()
            }
        }
    }
}

/// Imports that lead up or aside, modules without a storey, and storeys without a module.
pub(crate) fn check(tree: &Tree, edges: &[Edge], table: &[(&str, Storeys)]) -> Vec<Offence> {
    let mut offences = Vec::new();
    for (source, storeys) in table {
        let rows = storeys.rows();
        let present = modules(tree, source);
        for (module, file) in &present {
            if !rows.contains_key(module) {
                offences.push(Offence::new(file, 1, format!("{module} has no storey")));
            }
        }
        for module in rows.keys().filter(|module| !present.contains_key(*module)) {
            let text = format!("a storey for {module}, which is not there");
            offences.push(Offence::new(&format!("{source}/{module}"), 1, text));
        }
        let barred = |from: &str, to: &str| {
            from != to && rows.get(from).is_some_and(|may| !may.contains(to))
        };
        offences.extend(imports(source, edges, barred));
    }
    offences
}

/// The imports from one module of a crate to another that are barred, told once a file and module.
fn imports(
    source: &str,
    edges: &[Edge],
    barred: impl Fn(&str, &str) -> bool,
) -> impl Iterator<Item = Offence> {
    let mut found: BTreeMap<(&str, &str, &str), Vec<&Edge>> = BTreeMap::new();
    for edge in edges {
        if let (Some(from), Some(to)) = (module(source, &edge.from), module(source, &edge.to))
            && barred(from, to)
        {
            found.entry((&edge.from, from, to)).or_default().push(edge);
        }
    }
    found.into_iter().map(|((file, from, to), edges)| {
        let line = edges.iter().map(|edge| edge.line).min().unwrap_or(1);
        let items = some_of(edges.into_iter().map(|edge| edge.item.clone()));
        Offence::new(file, line, format!("{from} may not import {to}: {items}"))
    })
}

/// Imports between modules that must not know each other; also a module that is not there, because
/// a rule about a name that is gone keeps nothing.
pub(crate) fn check_apart(
    tree: &Tree,
    edges: &[Edge],
    table: &[(&str, &str, &[&str])],
) -> Vec<Offence> {
    let mut offences = Vec::new();
    for &(source, module_from, others) in table {
        let present = modules(tree, source);
        for name in others.iter().chain([&module_from]).filter(|n| !present.contains_key(**n)) {
            let text = format!("{name} is not there");
            offences.push(Offence::new(&format!("{source}/{name}"), 1, text));
        }
        let barred = |from: &str, to: &str| from == module_from && others.contains(&to);
        offences.extend(imports(source, edges, barred));
    }
    offences
}

/// Edges between the top-level modules of a crate in place of those between files; those within a
/// circle of files are left out, because that circle is told already.
pub(crate) fn of_modules(edges: &[Edge], sources: &[String]) -> Vec<Edge> {
    let circles = circles::circles(edges);
    let told = |edge: &&Edge| {
        circles.iter().any(|c| c.contains(edge.from.as_str()) && c.contains(edge.to.as_str()))
    };
    let mut found = Vec::new();
    for source in sources {
        for edge in edges.iter().filter(|edge| !told(edge)) {
            let (Some(from), Some(to)) = (module(source, &edge.from), module(source, &edge.to))
            else {
                continue;
            };
            if from != to {
                let whole = |name: &str| format!("{source}/{name}");
                let item = format!("{} in {}", edge.item, edge.from);
                found.push(Edge { from: whole(from), to: whole(to), line: edge.line, item });
            }
        }
    }
    found
}

/// The top-level module that a file of these sources belongs to; the roots are none.
fn module<'a>(source: &str, path: &'a str) -> Option<&'a str> {
    let path = path.strip_prefix(source)?.strip_prefix('/')?;
    let name = match path.split_once('/') {
        Some((folder, _)) => folder,
        None => path.strip_suffix(".rs")?,
    };
    (!["lib", "main", "bin", "tests"].contains(&name)).then_some(name)
}

/// The top-level modules of these sources, each with a file of its own.
fn modules<'a>(tree: &'a Tree, source: &str) -> BTreeMap<&'a str, &'a str> {
    let files = tree.with_extension("rs").map(|(path, _)| path);
    files.filter_map(|path| Some((module(source, path)?, path))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::all_edges;

    const TABLE: &[(&str, Storeys)] =
        &[("x/src", Storeys::Table(&[("low", &[]), ("up", &["low"])]))];
    const LADDER: &[(&str, Storeys)] = &[("x/src", Storeys::Ladder(&["low", "up"]))];

    fn tree(low: &str, other: &str) -> Tree {
        Tree::of(&[
            ("x/Cargo.toml", "[package]\nname = \"x\"\n"),
            ("x/src/lib.rs", "mod low; mod up; mod other;"),
            ("x/src/low/mod.rs", "mod part; mod free; pub struct Low;"),
            ("x/src/low/part.rs", low),
            ("x/src/low/free.rs", "pub struct Free;"),
            ("x/src/up.rs", "use crate::low::Low; pub struct Up(Low);"),
            (other, ""),
        ])
    }

    fn told(tree: &Tree, table: &[(&str, Storeys)]) -> Vec<String> {
        check(tree, &all_edges(tree), table).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn downward_imports_pass() {
        let tree = tree("use super::Low; fn f(_: super::free::Free) {}", "y.rs");
        assert!(told(&tree, TABLE).is_empty() && told(&tree, LADDER).is_empty());
        assert!(check_apart(&tree, &all_edges(&tree), &[("x/src", "low", &["up"])]).is_empty());
    }

    #[test]
    fn upward_imports_and_modules_without_a_storey_are_told() {
        let tree = tree("fn f(_: crate::up::Up) {}", "x/src/other.rs");
        let expected = [
            "x/src/other.rs:1: other has no storey",
            "x/src/low/part.rs:1: low may not import up: crate::up::Up",
        ];
        assert_eq!(told(&tree, TABLE), expected);
        assert_eq!(told(&tree, LADDER), expected);
        let apart = check_apart(&tree, &all_edges(&tree), &[("x/src", "low", &["up", "gone"])]);
        let apart: Vec<String> = apart.iter().map(ToString::to_string).collect();
        let named = "x/src/low/part.rs:1: low may not import up: crate::up::Up";
        assert_eq!(apart, ["x/src/gone:1: gone is not there", named]);
    }

    #[test]
    fn a_circle_of_modules_needs_no_circle_of_files() {
        let tree = tree("fn f(_: crate::up::Up) {}", "y.rs");
        let edges = all_edges(&tree);
        assert!(circles::check(&edges).is_empty());
        let modules = of_modules(&edges, &["x/src".to_owned()]);
        assert_eq!(circles::check(&modules).len(), 1);
    }
}
