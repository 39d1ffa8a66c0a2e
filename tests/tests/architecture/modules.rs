//! The modules of one target: which file each is, what it defines and what it imports.

use std::collections::{BTreeMap, BTreeSet};

use syn::{Attribute, Expr, ExprLit, Item, ItemMod, ItemUse, Lit, Meta, UseTree, Visibility};

use crate::tokens::{defined_by_macro, only_in_tests};
use crate::tree::{Tree, folder, join};

/// All modules that are reached from a target's root file, tests left out.
#[derive(Default)]
pub(crate) struct Modules {
    /// The root first.
    pub(crate) all: Vec<Module>,
    /// Files whose `mod` declaration says that they are there in tests only.
    pub(crate) test_files: BTreeSet<String>,
}

/// A module: a file, or a part of one in braces.
pub(crate) struct Module {
    pub(crate) file: String,
    pub(crate) parent: Option<usize>,
    pub(crate) children: BTreeMap<String, usize>,
    /// Names that are defined here: types, values and macros alike.
    pub(crate) defined: BTreeSet<String>,
    pub(crate) imports: Vec<Import>,
    /// Everything else.
    pub(crate) items: Vec<Item>,
}

/// One name that a `use` brings in, or a glob.
#[derive(Clone, Debug)]
pub(crate) struct Import {
    pub(crate) path: Vec<String>,
    /// The name it has here; `None` for a glob.
    pub(crate) name: Option<String>,
    pub(crate) line: usize,
    /// Handed on to others: more than a private `use`.
    pub(crate) reexport: bool,
}

/// Where a module's text and the files of its children are.
struct Place {
    file: String,
    children: String,
    parent: Option<usize>,
}

/// Parses one file; says which where it cannot be parsed.
pub(crate) fn parse(path: &str, text: &str) -> syn::File {
    syn::parse_file(text)
        .unwrap_or_else(|e| panic!("{path}:{}: not Rust: {e}", e.span().start().line))
}

impl Modules {
    /// Reads the modules of the target with this root file.
    pub(crate) fn read(tree: &Tree, root: &str) -> Self {
        let mut modules = Self::default();
        if let Some(text) = tree.text(root) {
            let place =
                Place { file: root.to_owned(), children: folder(root).to_owned(), parent: None };
            modules.add(tree, place, parse(root, text).items);
        }
        modules
    }

    fn add(&mut self, tree: &Tree, place: Place, items: Vec<Item>) -> usize {
        let id = self.all.len();
        self.all.push(Module {
            file: place.file.clone(),
            parent: place.parent,
            children: BTreeMap::new(),
            defined: BTreeSet::new(),
            imports: Vec::new(),
            items: Vec::new(),
        });
        for item in items {
            if only_in_tests(attributes(&item)) {
                if let Item::Mod(declared) = &item {
                    let files = child_files(tree, &place.file, &place.children, declared);
                    self.test_files.extend(files);
                }
                continue;
            }
            match item {
                Item::Mod(child) => {
                    let name = child.ident.to_string();
                    if let Some(child) = self.add_child(tree, &place, id, child) {
                        self.all[id].children.insert(name, child);
                    }
                }
                Item::Use(item) => self.all[id].imports.extend(imports(&item)),
                item => {
                    self.all[id].defined.extend(names(&item));
                    self.all[id].items.push(item);
                }
            }
        }
        id
    }

    /// A child in braces, or in a file of its own; `None` where there is no such file.
    fn add_child(
        &mut self,
        tree: &Tree,
        place: &Place,
        parent: usize,
        child: ItemMod,
    ) -> Option<usize> {
        let parent = Some(parent);
        let children = format!("{}/{}", place.children, child.ident);
        if let Some((_, items)) = child.content {
            let place = Place { file: place.file.clone(), children, parent };
            return Some(self.add(tree, place, items));
        }
        let file = child_file(tree, &place.file, &place.children, &child)?;
        let items = parse(&file, tree.text(&file)?).items;
        let own_folder = file.ends_with("/mod.rs") || path_attribute(&child.attrs).is_some();
        let children = if own_folder { folder(&file).to_owned() } else { children };
        Some(self.add(tree, Place { file, children, parent }, items))
    }

    /// The files of all modules.
    pub(crate) fn files(&self) -> BTreeSet<&str> {
        self.all.iter().map(|module| module.file.as_str()).collect()
    }
}

fn child_file(tree: &Tree, file: &str, children: &str, child: &ItemMod) -> Option<String> {
    let name = &child.ident;
    let candidates = match path_attribute(&child.attrs) {
        Some(path) => vec![join(folder(file), &path)?],
        None => vec![
            format!("{children}/{name}.rs").trim_start_matches('/').to_owned(),
            format!("{children}/{name}/mod.rs").trim_start_matches('/').to_owned(),
        ],
    };
    candidates.into_iter().find(|path| tree.has_file(path))
}

/// A child's file and those in its folder.
fn child_files(tree: &Tree, file: &str, children: &str, child: &ItemMod) -> Vec<String> {
    if child.content.is_some() {
        return Vec::new();
    }
    let below = format!("{children}/{}/", child.ident);
    let mut files: Vec<String> =
        tree.paths().filter(|path| path.starts_with(&below)).map(str::to_owned).collect();
    files.extend(child_file(tree, file, children, child));
    files
}

fn path_attribute(attributes: &[Attribute]) -> Option<String> {
    attributes.iter().find_map(|attribute| match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident("path") => match &pair.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    })
}

/// The names that a `use` brings in.
pub(crate) fn imports(item: &ItemUse) -> Vec<Import> {
    let mut found = Vec::new();
    let reexport = !matches!(item.vis, Visibility::Inherited);
    flatten(&item.tree, &mut Vec::new(), reexport, &mut found);
    found
}

fn flatten(tree: &UseTree, path: &mut Vec<String>, reexport: bool, found: &mut Vec<Import>) {
    let (ident, name) = match tree {
        UseTree::Path(step) => {
            path.push(step.ident.to_string());
            flatten(&step.tree, path, reexport, found);
            path.pop();
            return;
        }
        UseTree::Group(group) => {
            group.items.iter().for_each(|tree| flatten(tree, path, reexport, found));
            return;
        }
        UseTree::Glob(glob) => {
            let line = glob.star_token.spans[0].start().line;
            found.push(Import { path: path.clone(), name: None, line, reexport });
            return;
        }
        UseTree::Name(name) => (&name.ident, &name.ident),
        UseTree::Rename(rename) => (&rename.ident, &rename.rename),
    };
    let line = ident.span().start().line;
    let mut path = path.clone();
    let name = if ident == "self" && ident == name { path.last().cloned() } else { None };
    let name = name.unwrap_or_else(|| match tree {
        UseTree::Rename(rename) => rename.rename.to_string(),
        _ => ident.to_string(),
    });
    if ident != "self" || path.is_empty() {
        path.push(ident.to_string());
    }
    found.push(Import { path, name: Some(name), line, reexport });
}

/// The names that an item defines.
pub(crate) fn names(item: &Item) -> Vec<String> {
    let ident = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        Item::Macro(item) => match &item.ident {
            Some(ident) => ident,
            None => {
                let defined = defined_by_macro(item.mac.tokens.clone());
                return defined.into_iter().map(|(name, ..)| name).collect();
            }
        },
        _ => return Vec::new(),
    };
    vec![ident.to_string()]
}

/// The attributes of an item.
pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

#[test]
fn modules_are_read() {
    let tree = Tree::of(&[
        ("c/src/lib.rs", "mod a;\npub use a::{self as b, X as Y, d::*};\n#[cfg(test)]\nmod t;\n"),
        ("c/src/a.rs", "pub mod d;\npub struct X;\nmod inner { fn f() {} }\n#[test]\nfn g() {}\n"),
        ("c/src/a/d.rs", "wire! { Kind { A = 1 } }\n"),
        ("c/src/t/mod.rs", ""),
    ]);
    let modules = Modules::read(&tree, "c/src/lib.rs");
    assert_eq!(modules.files().len(), 3);
    assert_eq!(modules.test_files.iter().collect::<Vec<_>>(), ["c/src/t/mod.rs"]);
    let imported: Vec<String> = modules.all[0]
        .imports
        .iter()
        .map(|i| format!("{} {}", i.path.join("::"), i.name.as_deref().unwrap_or("*")))
        .collect();
    assert_eq!(imported, ["a b", "a::X Y", "a::d *"]);
    let defined: Vec<&str> =
        modules.all.iter().flat_map(|m| &m.defined).map(String::as_str).collect();
    assert_eq!(defined, ["X", "Kind", "f"]);
}
