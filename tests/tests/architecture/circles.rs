//! No circle of files: inside a target, files that name each other's items are one file in pieces.

use std::collections::{BTreeMap, BTreeSet};

use crate::edges::Edge;
use crate::tree::{Offence, some_of};

/// Every set of files that can all be reached from each other, with the edges among them.
pub(crate) fn check(edges: &[Edge]) -> Vec<Offence> {
    let mut offences = Vec::new();
    for circle in circles(edges) {
        let mut pairs: BTreeMap<(&str, &str), Vec<&Edge>> = BTreeMap::new();
        for edge in edges {
            if circle.contains(edge.from.as_str()) && circle.contains(edge.to.as_str()) {
                pairs.entry((&edge.from, &edge.to)).or_default().push(edge);
            }
        }
        let mut text = format!("a circle of {}", circle.len());
        for ((from, to), edges) in pairs {
            let items = edges.iter().map(|edge| format!("{} (line {})", edge.item, edge.line));
            text += &format!("\n    {from} → {to}: {}", some_of(items));
        }
        let first = circle.first().copied().unwrap_or_default();
        offences.push(Offence::new(first, 1, text));
    }
    offences
}

/// The strongly connected components of more than one file.
pub(crate) fn circles(edges: &[Edge]) -> Vec<BTreeSet<&str>> {
    let mut search = Tarjan::default();
    for edge in edges {
        search.next.entry(edge.from.as_str()).or_default().insert(edge.to.as_str());
    }
    let files: Vec<&str> = search.next.keys().copied().collect();
    for file in files {
        if !search.index.contains_key(file) {
            search.visit(file);
        }
    }
    search.found
}

/// Tarjan's search: a file closes a component where nothing behind it leads further back.
#[derive(Default)]
struct Tarjan<'a> {
    next: BTreeMap<&'a str, BTreeSet<&'a str>>,
    index: BTreeMap<&'a str, usize>,
    lowest: BTreeMap<&'a str, usize>,
    stack: Vec<&'a str>,
    found: Vec<BTreeSet<&'a str>>,
}

impl<'a> Tarjan<'a> {
    fn visit(&mut self, file: &'a str) -> usize {
        let index = self.index.len();
        self.index.insert(file, index);
        self.stack.push(file);
        let mut lowest = index;
        for next in self.next.get(file).cloned().unwrap_or_default() {
            if !self.index.contains_key(next) {
                lowest = lowest.min(self.visit(next));
            } else if self.stack.contains(&next) {
                lowest = lowest.min(self.index[next]);
            }
        }
        self.lowest.insert(file, lowest);
        if lowest == index {
            let at = self.stack.iter().position(|&f| f == file).unwrap_or(0);
            let component: BTreeSet<&str> = self.stack.drain(at..).collect();
            if component.len() > 1 {
                self.found.push(component);
            }
        }
        lowest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edges::all_edges;
    use crate::tree::Tree;

    fn found(b: &str) -> Vec<Offence> {
        let tree = Tree::of(&[
            ("x/Cargo.toml", "[package]\nname = \"x\"\n"),
            ("x/src/lib.rs", "mod a; mod b; mod c; pub use a::A;"),
            ("x/src/a.rs", "use crate::b::B;\npub struct A(B);"),
            ("x/src/b.rs", b),
            ("x/src/c.rs", "pub struct C; pub fn f(_: crate::A) {}"),
        ]);
        check(&all_edges(&tree))
    }

    #[test]
    fn a_circle_through_a_facade_is_found() {
        let offences = found("pub struct B;\nfn f() { crate::c::f(loop {}); }");
        assert_eq!(offences.len(), 1);
        let text = offences[0].to_string();
        assert!(text.contains("a circle of 3"), "{text}");
        assert!(text.contains("x/src/b.rs → x/src/c.rs: crate::c::f (line 2)"), "{text}");
        assert!(text.contains("x/src/c.rs → x/src/a.rs: crate::A (line 1)"), "{text}");
    }

    #[test]
    fn a_straight_way_is_none() {
        assert_eq!(found("pub struct B;"), []);
        let in_tests = "pub struct B;\n#[cfg(test)]\nmod tests { use crate::c::C; }";
        assert_eq!(found(in_tests), []);
    }
}
