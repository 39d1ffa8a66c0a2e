//! Files and functions are short, and functions take few parameters.

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Block, FnArg, ImplItemFn, ItemFn, Signature, TraitItemFn};

use crate::house::{FILE_LINES, FUNCTION_LINES, PARAMETERS};
use crate::modules::parse;
use crate::tree::{Offence, Tree};

/// What is too long; tests may have as many parameters as they like.
pub(crate) fn check(tree: &Tree) -> Vec<Offence> {
    let mut offences = Vec::new();
    for (path, text) in tree.with_extension("rs") {
        let lines = text.lines().count();
        if lines > FILE_LINES {
            let text = format!("the file has {lines} lines, at most {FILE_LINES}");
            offences.push(Offence::new(path, FILE_LINES + 1, text));
        }
        let in_test = path.split('/').skip(1).any(|part| ["tests", "tests.rs"].contains(&part));
        let mut reader = Reader { path, in_test, offences: &mut offences };
        reader.visit_file(&parse(path, text));
    }
    offences
}

struct Reader<'a> {
    path: &'a str,
    in_test: bool,
    offences: &'a mut Vec<Offence>,
}

impl Reader<'_> {
    fn function(&mut self, signature: &Signature, body: Option<&Block>) {
        let name = &signature.ident;
        let first = signature.span().start().line;
        let typed = |input: &&FnArg| matches!(input, FnArg::Typed(_));
        let parameters = signature.inputs.iter().filter(typed).count();
        if parameters > PARAMETERS && !self.in_test {
            let text = format!("{name} takes {parameters} parameters, at most {PARAMETERS}");
            self.offences.push(Offence::new(self.path, first, text));
        }
        let lines = body.map_or(0, |b| b.brace_token.span.close().end().line + 1 - first);
        if lines > FUNCTION_LINES {
            let text = format!("{name} has {lines} lines, at most {FUNCTION_LINES}");
            self.offences.push(Offence::new(self.path, first, text));
        }
    }
}

impl<'ast> Visit<'ast> for Reader<'_> {
    fn visit_item_fn(&mut self, item: &'ast ItemFn) {
        self.function(&item.sig, Some(&item.block));
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast ImplItemFn) {
        self.function(&item.sig, Some(&item.block));
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'ast TraitItemFn) {
        self.function(&item.sig, item.default.as_ref());
        visit::visit_trait_item_fn(self, item);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(text: &str) -> Vec<String> {
        let tree = Tree::of(&[("x/src/a.rs", text), ("x/tests/t.rs", MANY)]);
        check(&tree).iter().map(ToString::to_string).collect()
    }

    const MANY: &str = "fn f(a: u8, b: u8, c: u8, d: u8, e: u8, f: u8, g: u8) {}";

    #[test]
    fn what_is_short_enough_passes() {
        assert!(told(&"\n".repeat(FILE_LINES)).is_empty());
        let body = "\n".repeat(FUNCTION_LINES - 1);
        assert!(told(&format!("/// Of.\n#[x]\npub fn f() {{{body}}}")).is_empty());
        let method = MANY.replacen("a: u8", "&self", 1);
        assert!(told(&format!("impl A {{ {method} }}")).is_empty());
    }

    #[test]
    fn what_is_too_long_is_told() {
        let long = told(&"\n".repeat(FILE_LINES + 1));
        assert_eq!(long, ["x/src/a.rs:451: the file has 451 lines, at most 450"]);
        let body = "\n".repeat(FUNCTION_LINES);
        let long = told(&format!("trait A {{\nfn f(&self)\n{{{body}}} }}"));
        assert_eq!(long, ["x/src/a.rs:2: f has 102 lines, at most 100"]);
        assert_eq!(told(MANY), ["x/src/a.rs:1: f takes 7 parameters, at most 6"]);
    }
}
