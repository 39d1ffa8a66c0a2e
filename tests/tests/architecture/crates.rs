//! The graph of crates is the table of crates.

use std::collections::{BTreeMap, BTreeSet};

use crate::house::{Crate, May};
use crate::packages::{Package, packages};
use crate::tree::{Offence, Tree};

/// Crates that the table does not know, and dependencies that it does not allow or that are gone.
pub(crate) fn check(tree: &Tree, table: &[Crate]) -> Vec<Offence> {
    let mut offences = Vec::new();
    let packages = packages(tree);
    for package in &packages {
        match table.iter().find(|row| row.dir == package.dir) {
            Some(row) => offences.extend(check_one(package, row)),
            None => offences.push(offence(package, 1, "a crate that the table does not know")),
        }
    }
    for row in table.iter().filter(|row| packages.iter().all(|package| package.dir != row.dir)) {
        let text = "the table knows this crate, but it is not there";
        offences.push(Offence::new(&format!("{}/Cargo.toml", row.dir), 1, text));
    }
    offences
}

fn check_one(package: &Package, row: &Crate) -> Vec<Offence> {
    let mut offences = Vec::new();
    let allowed = match row.may {
        May::Import(allowed) => allowed,
        May::ImportAll => return offences,
    };
    let ours = package.dependencies.iter().filter_map(|d| Some((d.dir.as_deref()?, d)));
    let ours: Vec<_> = ours.collect();
    for &(dir, dependency) in &ours {
        let known = allowed.contains(&dir) || (dependency.dev && row.dev.contains(&dir));
        if !known {
            let kind = if dependency.dev { "in its tests" } else { "" };
            let text = format!("may not depend on {dir} {kind}");
            offences.push(offence(package, dependency.line, text.trim_end()));
        }
    }
    for (list, dev) in [(allowed, false), (row.dev, true)] {
        for &dir in list {
            if !ours.iter().any(|&(d, dependency)| d == dir && dependency.dev == dev) {
                offences.push(offence(package, 1, &format!("needs no {dir}: strike it")));
            }
        }
    }
    offences
}

/// Ways from one stranger to the other, tests included.
pub(crate) fn check_strangers(tree: &Tree, strangers: &[(&str, &str)]) -> Vec<Offence> {
    let packages = packages(tree);
    let mut next: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in &packages {
        let dirs = package.dependencies.iter().filter_map(|d| d.dir.as_deref());
        next.entry(package.dir.as_str()).or_default().extend(dirs);
    }
    let mut offences = Vec::new();
    for &(one, other) in strangers {
        for (from, to) in [(one, other), (other, one)] {
            let mut reached = BTreeSet::new();
            let mut open = vec![from];
            while let Some(dir) = open.pop() {
                if reached.insert(dir) {
                    open.extend(next.get(dir).into_iter().flatten());
                }
            }
            if reached.contains(to) {
                let text = format!("a way leads from {from} to {to}");
                offences.push(Offence::new(&format!("{from}/Cargo.toml"), 1, text));
            }
        }
    }
    offences
}

fn offence(package: &Package, line: usize, text: &str) -> Offence {
    Offence::new(&package.manifest_path(), line, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &[Crate] = &[
        Crate { dir: "low", may: May::Import(&[]), dev: &[] },
        Crate { dir: "up", may: May::Import(&["low"]), dev: &[] },
    ];

    fn tree(low: &str, up: &str) -> Tree {
        let low = format!("[package]\nname = \"low\"\n{low}");
        let up = format!("[package]\nname = \"up\"\n{up}");
        Tree::of(&[("low/Cargo.toml", &low), ("up/Cargo.toml", &up)])
    }

    fn told(low: &str, up: &str) -> Vec<String> {
        check(&tree(low, up), TABLE).iter().map(ToString::to_string).collect()
    }

    const LOW: &str = "[dependencies]\nlow = { path = \"../low\" }\n";
    const UP: &str = "[dev-dependencies]\nup = { path = \"../up\" }\n";

    #[test]
    fn what_the_table_allows_passes() {
        assert!(told("", LOW).is_empty());
        assert!(check_strangers(&tree("", ""), &[("low", "up")]).is_empty());
    }

    #[test]
    fn what_the_table_does_not_allow_is_told() {
        assert_eq!(told(UP, LOW), ["low/Cargo.toml:4: may not depend on up in its tests"]);
        assert_eq!(told("", ""), ["up/Cargo.toml:1: needs no low: strike it"]);
        let dev = LOW.replace("dependencies", "dev-dependencies");
        assert_eq!(told("", &dev), ["up/Cargo.toml:1: needs no low: strike it"]);
        assert_eq!(check_strangers(&tree("", LOW), &[("low", "up")]).len(), 1);
        let other = Tree::of(&[("new/Cargo.toml", "[package]\nname = \"new\"\n")]);
        assert_eq!(check(&other, TABLE).len(), 3);
    }
}
