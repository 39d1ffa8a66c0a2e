//! From a path as it is written to the module that defines what it names.

use std::collections::BTreeSet;

use crate::modules::{Import, Modules};

/// What a path leads to. Items are told by their module only: that says which file it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Target {
    Module(usize),
    Item(usize),
}

/// What was asked already: a module, a name in it, and whether more of a path follows that name.
/// Re-exports may go round in circles, but `use clean::clean` asks two things of one name.
type Asked = BTreeSet<(usize, String, bool)>;

impl Modules {
    /// What a path in a module leads to; nothing where it leaves the crate. `local` are the
    /// imports of the blocks around it.
    pub(crate) fn resolve(&self, module: usize, path: &[String], local: &[Import]) -> Vec<Target> {
        if let Some(at) = local.iter().rposition(|import| import.name.as_ref() == path.first()) {
            let path: Vec<String> = local[at].path.iter().chain(&path[1..]).cloned().collect();
            return self.resolve(module, &path, &local[..at]);
        }
        self.follow(module, path, &mut Asked::new())
    }

    fn follow(&self, module: usize, path: &[String], asked: &mut Asked) -> Vec<Target> {
        let Some((first, rest)) = path.split_first() else { return Vec::new() };
        let mut targets = match first.as_str() {
            "crate" => vec![Target::Module(0)],
            "self" => vec![Target::Module(module)],
            "super" => self.all[module].parent.map(Target::Module).into_iter().collect(),
            _ => self.lookup(module, first, !rest.is_empty(), asked),
        };
        for (i, name) in rest.iter().enumerate() {
            targets = self.step(&targets, name, i + 1 < rest.len(), asked);
        }
        targets
    }

    /// One `::` further. Behind an item come its variants and functions: still the item. A name
    /// that a module does not seem to have (a macro made it) is taken for an item of that module.
    fn step(&self, from: &[Target], name: &str, more: bool, asked: &mut Asked) -> Vec<Target> {
        let modules: Vec<usize> = from.iter().filter_map(|target| target.module()).collect();
        if modules.is_empty() {
            return from.to_vec();
        }
        let mut found = Vec::new();
        for &module in &modules {
            match name {
                "super" => found.extend(self.all[module].parent.map(Target::Module)),
                "self" => found.push(Target::Module(module)),
                _ => found.extend(self.lookup(module, name, more, asked)),
            }
        }
        if found.is_empty() {
            found.extend(from.iter().filter(|target| target.module().is_none()));
        }
        if found.is_empty() {
            found.extend(modules.into_iter().map(Target::Item));
        }
        found
    }

    /// Everything that a name may mean in a module: a function may share it with a module.
    fn lookup(&self, module: usize, name: &str, more: bool, asked: &mut Asked) -> Vec<Target> {
        if !asked.insert((module, name.to_owned(), more)) {
            return Vec::new();
        }
        let here = &self.all[module];
        let mut found = BTreeSet::new();
        if here.defined.contains(name) {
            found.insert(Target::Item(module));
        }
        found.extend(here.children.get(name).copied().map(Target::Module));
        for import in here.imports.iter().filter(|import| import.name.as_deref() == Some(name)) {
            found.extend(self.follow(module, &import.path, asked));
        }
        if found.is_empty() {
            for glob in here.imports.iter().filter(|import| import.name.is_none()) {
                // A glob may be reached by several names: each is asked afresh.
                let from = self.follow(module, &glob.path, &mut asked.clone());
                for module in from.iter().filter_map(|target| target.module()) {
                    found.extend(self.lookup(module, name, more, asked));
                }
            }
        }
        found.into_iter().collect()
    }
}

impl Target {
    fn module(self) -> Option<usize> {
        match self {
            Self::Module(module) => Some(module),
            Self::Item(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Tree;

    fn leads_to(modules: &Modules, from: &str, path: &str) -> Vec<String> {
        let at = modules.all.iter().position(|module| module.file == from).expect("a module");
        let path: Vec<String> = path.split("::").map(str::to_owned).collect();
        let targets = modules.resolve(at, &path, &[]);
        let told = targets.into_iter().map(|target| match target {
            Target::Module(module) => format!("mod {}", modules.all[module].file),
            Target::Item(module) => modules.all[module].file.clone(),
        });
        told.collect()
    }

    #[test]
    fn paths_lead_to_the_defining_file() {
        let tree = Tree::of(&[
            ("lib.rs", "mod scan; pub mod plan; pub use scan::*; use plan::Plan as P; mod x;"),
            ("scan/mod.rs", "mod clean; mod deep; pub use clean::clean; pub use deep::*;"),
            ("scan/clean.rs", "pub fn clean() {}"),
            ("scan/deep.rs", "pub struct Deep; pub use super::*;"),
            ("plan.rs", "pub enum Plan { A } wire! { #[doc] }"),
            ("x.rs", "use crate::scan; use std::fmt;"),
        ]);
        let modules = Modules::read(&tree, "lib.rs");
        let to = |path| leads_to(&modules, "x.rs", path);
        assert_eq!(to("crate::Deep"), ["scan/deep.rs"]);
        assert_eq!(to("crate::P::A"), ["plan.rs"]);
        assert_eq!(to("super::plan::Made"), ["plan.rs"]);
        assert_eq!(to("scan::clean"), ["mod scan/clean.rs", "scan/clean.rs"]);
        assert_eq!(to("scan::clean::clean"), ["scan/clean.rs"]);
        assert_eq!(to("scan"), ["mod scan/mod.rs"]);
        assert!(to("fmt::Display").is_empty() && to("serde::Serialize").is_empty());
        assert!(to("Vec").is_empty());
    }
}
