//! Which file names what another one defines.

use std::collections::{BTreeMap, BTreeSet};

use syn::visit::{self, Visit};
use syn::{
    Attribute, Block, ImplItemFn, ImplItemMacro, Item, ItemFn, Macro, PatIdent, Path, Stmt,
    TraitItemFn, Visibility,
};

use crate::modules::{Import, Modules, imports, names};
use crate::names::Target;
use crate::packages::packages;
use crate::tokens::{only_in_tests, paths};
use crate::tree::Tree;

/// A file names an item of another one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) line: usize,
    /// The path, as it is written.
    pub(crate) item: String,
}

/// The edges of every target in the tree.
pub(crate) fn all_edges(tree: &Tree) -> Vec<Edge> {
    let roots: BTreeSet<String> = packages(tree).iter().flat_map(|p| p.roots(tree)).collect();
    let edges = roots.iter().flat_map(|root| edges(&Modules::read(tree, root)));
    edges.collect::<BTreeSet<Edge>>().into_iter().collect()
}

/// The edges of one target, each pair of files and item once.
pub(crate) fn edges(modules: &Modules) -> Vec<Edge> {
    let mut found = BTreeMap::new();
    for (id, module) in modules.all.iter().enumerate() {
        let mut reader = Reader {
            modules,
            module: id,
            local: Vec::new(),
            bound: BTreeSet::new(),
            imported: BTreeSet::new(),
            found: &mut found,
        };
        for import in module.imports.iter().filter(|import| !import.reexport) {
            reader.import(import);
        }
        for item in &module.items {
            reader.visit_item(item);
        }
    }
    let edges = found.into_iter().map(|((from, to, item), line)| Edge { from, to, line, item });
    edges.collect()
}

/// Goes through one module and notes what it names.
struct Reader<'a> {
    modules: &'a Modules,
    module: usize,
    /// Imports of the blocks that it is in, the innermost last.
    local: Vec<Import>,
    /// Names that the function around it gives to values of its own.
    bound: BTreeSet<String>,
    /// Modules and the names that an import brought from there: their uses need not be told.
    imported: BTreeSet<(usize, String)>,
    found: &'a mut BTreeMap<(String, String, String), usize>,
}

impl Reader<'_> {
    fn import(&mut self, import: &Import) {
        let glob = import.name.is_none();
        let text = import.path.join("::") + if glob { "::*" } else { "" };
        for target in self.modules.resolve(self.module, &import.path, &[]) {
            match target {
                Target::Item(module) => {
                    self.note(module, &text, import.line);
                    self.imported.extend(import.name.clone().map(|name| (module, name)));
                }
                Target::Module(module) if glob => self.note(module, &text, import.line),
                Target::Module(_) => {}
            }
        }
    }

    fn path(&mut self, segments: &[String], line: usize) {
        if segments.len() == 1 && self.bound.contains(&segments[0]) {
            return;
        }
        for target in self.modules.resolve(self.module, segments, &self.local) {
            if let Target::Item(module) = target
                && !self.imported.contains(&(module, segments[0].clone()))
            {
                self.note(module, &segments.join("::"), line);
            }
        }
    }

    fn note(&mut self, module: usize, item: &str, line: usize) {
        let from = &self.modules.all[self.module].file;
        let to = &self.modules.all[module].file;
        if from != to {
            let first =
                self.found.entry((from.clone(), to.clone(), item.to_owned())).or_insert(line);
            *first = line.min(*first);
        }
    }

    /// Goes through a function with the names that it binds.
    fn function(&mut self, visit: impl FnOnce(&mut Self), bound: Bound) {
        let outer = self.bound.clone();
        self.bound.extend(bound.0);
        visit(self);
        self.bound = outer;
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_attribute(&mut self, _: &'ast Attribute) {}

    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        let mut bound = Bound::default();
        bound.visit_item_fn(item);
        self.function(|reader| visit::visit_item_fn(reader, item), bound);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        if only_in_tests(&item.attrs) {
            return;
        }
        let mut bound = Bound::default();
        bound.visit_impl_item_fn(item);
        self.function(|reader| visit::visit_impl_item_fn(reader, item), bound);
    }

    fn visit_impl_item_macro(&mut self, item: &'ast ImplItemMacro) {
        if !only_in_tests(&item.attrs) {
            visit::visit_impl_item_macro(self, item);
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'ast TraitItemFn) {
        let mut bound = Bound::default();
        bound.visit_trait_item_fn(item);
        self.function(|reader| visit::visit_trait_item_fn(reader, item), bound);
    }

    fn visit_block(&mut self, block: &'ast Block) {
        let outer = self.local.len();
        for statement in &block.stmts {
            if let Stmt::Item(Item::Use(item)) = statement {
                for import in imports(item) {
                    self.import(&import);
                    self.local.push(import);
                }
            }
        }
        visit::visit_block(self, block);
        self.local.truncate(outer);
    }

    fn visit_path(&mut self, path: &'ast Path) {
        if path.leading_colon.is_none() {
            let segments: Vec<String> =
                path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            let line = path.segments.first().map_or(0, |s| s.ident.span().start().line);
            self.path(&segments, line);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, mac: &'ast Macro) {
        self.visit_path(&mac.path);
        for path in paths(mac.tokens.clone()) {
            self.path(&path.segments, path.line);
        }
    }
}

/// The names that a function gives to its own values and items.
#[derive(Default)]
struct Bound(BTreeSet<String>);

impl<'ast> Visit<'ast> for Bound {
    fn visit_pat_ident(&mut self, pattern: &'ast PatIdent) {
        let name = pattern.ident.to_string();
        if name.starts_with(|first: char| !first.is_uppercase()) {
            self.0.insert(name);
        }
        visit::visit_pat_ident(self, pattern);
    }

    fn visit_stmt(&mut self, statement: &'ast Stmt) {
        if let Stmt::Item(item) = statement {
            self.0.extend(names(item));
        }
        visit::visit_stmt(self, statement);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(files: &[(&str, &str)]) -> Vec<String> {
        let tree = Tree::of(files);
        let edges = edges(&Modules::read(&tree, "lib.rs"));
        edges.iter().map(|e| format!("{}:{} {} {}", e.from, e.line, e.to, e.item)).collect()
    }

    #[test]
    fn every_way_to_name_an_item_is_seen() {
        let text = "use crate::b::{self, B};\nuse super::b::*;\nuse std::fmt;\n\
                    fn f(x: crate::b::B) -> b::B {\n assert!(b::g(x), \"{}\", super::b::N);\n \
                    use crate::c;\n c::h()\n}\n";
        let found = told(&[
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", text),
            ("b.rs", "pub struct B; pub const N: u8 = 1; pub fn g(_: B) -> bool { true }"),
            ("c.rs", "pub fn h() -> crate::b::B { loop {} }"),
        ]);
        let expected = [
            "a.rs:4 b.rs b::B",
            "a.rs:5 b.rs b::g",
            "a.rs:1 b.rs crate::b::B",
            "a.rs:2 b.rs super::b::*",
            "a.rs:5 b.rs super::b::N",
            "a.rs:7 c.rs c::h",
            "c.rs:1 b.rs crate::b::B",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn an_item_with_its_modules_name_is_seen() {
        let found = told(&[("lib.rs", "mod a; fn f() { a::a() }"), ("a.rs", "pub fn a() {}")]);
        assert_eq!(found, ["lib.rs:1 a.rs a::a"]);
    }

    #[test]
    fn facades_tests_and_values_of_ones_own_are_no_edges() {
        let found = told(&[
            ("lib.rs", "mod a; mod b; pub use b::{g, B}; fn f() { let g = 1; h(g, self::a()); }"),
            ("a.rs", "use crate::b;\n#[cfg(test)]\nmod tests { use crate::b::g; }"),
            ("b.rs", "pub fn g() {} pub struct B; #[test] fn t() { crate::a::x(); }"),
        ]);
        assert!(found.is_empty(), "{found:#?}");
    }
}
