//! Every way to refuse is provoked, or at least named, by a test.

use std::collections::BTreeSet;

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::Item;

use crate::modules::{Modules, attributes, parse};
use crate::packages::packages;
use crate::tokens::{defined_by_macro, only_in_tests, paths, tokens, variants};
use crate::tree::{Offence, Tree};

/// A variant of one of the enums.
#[derive(Debug)]
struct Variant {
    of: String,
    name: String,
    file: String,
    line: usize,
}

/// Variants of these enums that no test names as `Enum::Variant`. Files below `except` are no
/// tests: they name what they please.
pub(crate) fn check(tree: &Tree, enums: &[&str], except: &str) -> Vec<Offence> {
    let tests = test_files(tree);
    let mut named = BTreeSet::new();
    let mut found = Vec::new();
    for (path, text) in tree.with_extension("rs").filter(|(path, _)| !path.starts_with(except)) {
        let all = tokens(path, text);
        if tests.contains(path) {
            note(all, &mut named);
            continue;
        }
        test_parts(all, &mut named);
        found.extend(variants_in(path, &parse(path, text).items, enums));
    }
    let mut offences = Vec::new();
    for name in enums.iter().filter(|name| found.iter().all(|v| v.of != **name)) {
        offences.push(Offence::new("", 0, format!("there is no enum {name}")));
    }
    for Variant { of, name, file, line } in found {
        if !named.contains(&(of.clone(), name.clone())) {
            offences.push(Offence::new(&file, line, format!("no test names {of}::{name}")));
        }
    }
    offences
}

/// The variants of the enums in a file; also of those that a macro makes.
fn variants_in(file: &str, items: &[Item], enums: &[&str]) -> Vec<Variant> {
    let mut found = Vec::new();
    for item in items.iter().filter(|item| !only_in_tests(attributes(item))) {
        let mut add = |of: &str, name: String, line: usize| {
            if enums.contains(&of) {
                found.push(Variant { of: of.to_owned(), name, file: file.to_owned(), line });
            }
        };
        match item {
            Item::Enum(item) => {
                for variant in &item.variants {
                    let line = variant.ident.span().start().line;
                    add(&item.ident.to_string(), variant.ident.to_string(), line);
                }
            }
            Item::Macro(item) if item.ident.is_none() => {
                for (of, _, brace) in defined_by_macro(item.mac.tokens.clone()) {
                    variants(&brace).into_iter().for_each(|(name, line)| add(&of, name, line));
                }
            }
            Item::Mod(item) => {
                let inner = item.content.iter().flat_map(|(_, items)| items);
                let inner: Vec<Item> = inner.cloned().collect();
                found.extend(variants_in(file, &inner, enums));
            }
            _ => {}
        }
    }
    found
}

/// The files that are there in tests only.
fn test_files(tree: &Tree) -> BTreeSet<String> {
    let mut files = BTreeSet::new();
    for package in packages(tree) {
        let prefix = format!("{}/tests/", package.dir);
        files.extend(tree.paths().filter(|path| path.starts_with(&prefix)).map(str::to_owned));
        for root in package.roots(tree) {
            files.extend(Modules::read(tree, &root).test_files);
        }
    }
    files
}

/// Notes the first two names of each path's end: `crate::Reason::Start` is (Reason, Start).
fn note(all: TokenStream, named: &mut BTreeSet<(String, String)>) {
    for path in paths(all) {
        for pair in path.segments.windows(2) {
            named.insert((pair[0].clone(), pair[1].clone()));
        }
    }
}

/// Notes what stands in the braces behind `#[test]` and `#[cfg(test)]`.
fn test_parts(all: TokenStream, named: &mut BTreeSet<(String, String)>) {
    let all: Vec<TokenTree> = all.into_iter().collect();
    let mut in_test = false;
    for (i, token) in all.iter().enumerate() {
        match token {
            TokenTree::Group(group) if group.delimiter() == Delimiter::Bracket => {
                let hash =
                    i > 0 && matches!(&all[i - 1], TokenTree::Punct(p) if p.as_char() == '#');
                let text = group.stream().to_string().replace(' ', "");
                in_test |= hash && (text == "test" || text.starts_with("cfg(test"));
            }
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                if in_test {
                    note(group.stream(), named);
                } else {
                    test_parts(group.stream(), named);
                }
                in_test = false;
            }
            TokenTree::Punct(p) if p.as_char() == ';' => in_test = false,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(library: &str, test: &str) -> Vec<String> {
        let tree = Tree::of(&[
            ("x/Cargo.toml", "[package]\nname = \"x\"\n"),
            ("x/src/lib.rs", library),
            ("x/tests/t.rs", test),
            ("x/tests/rules/r.rs", "fn f() { Reason::C; }"),
        ]);
        let found = check(&tree, &["Reason", "Fault"], "x/tests/rules/");
        found.iter().map(ToString::to_string).collect()
    }

    const LIBRARY: &str = "pub enum Reason { A, B(u8), C }\nfn f() { Reason::C; }\n\
        wire_enum! { /// Of.\n Fault { #[x] D = 1 => \"d\", E = 2 => \"e\", } }\n";

    #[test]
    fn a_variant_that_no_test_names_is_told() {
        let found = told(LIBRARY, "fn t() { assert!(x == x::Reason::A); Fault::D }");
        let expected = [
            "x/src/lib.rs:1: no test names Reason::B",
            "x/src/lib.rs:1: no test names Reason::C",
            "x/src/lib.rs:4: no test names Fault::E",
        ];
        assert_eq!(found, expected);
        assert_eq!(
            told("enum Reason { A }", "fn t() { Reason::A; }"),
            [":0: there is no enum Fault"]
        );
    }

    #[test]
    fn tests_in_the_source_count() {
        let library = format!(
            "{LIBRARY}#[cfg(test)]\nmod tests {{ fn a() {{ Reason::A; [Fault::D, Fault::E]; }} }}\n\
             mod m {{ #[test]\nfn t() {{ matches!(x, Reason::B(_) | Reason::C) }} }}"
        );
        assert!(told(&library, "").is_empty());
    }
}
