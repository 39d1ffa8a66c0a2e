//! What computes plans takes its elementary functions from `libm`: the processor's own library rounds
//! their last bit as it likes, and so does a product that is fused with a sum.

use proc_macro2::{Delimiter, TokenStream, TokenTree};

use crate::tokens::{paths, tokens};
use crate::tree::{Offence, Tree};

/// Methods of floating-point numbers that are not the same everywhere.
const LOOSE: &[&str] = &[
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "exp",
    "exp2", "exp_m1", "hypot", "ln", "ln_1p", "log", "log10", "log2", "mul_add", "mul_sub", "powf",
    "sin", "sin_cos", "sinh", "tan", "tanh",
];

/// Loose functions in the sources of these folders.
pub(crate) fn check(tree: &Tree, folders: &[&str]) -> Vec<Offence> {
    let mut offences = Vec::new();
    for (path, text) in tree.with_extension("rs") {
        if !folders.iter().any(|folder| path.starts_with(&format!("{folder}/"))) {
            continue;
        }
        let mut found = methods(tokens(path, text));
        for named in paths(tokens(path, text)) {
            if let [of, name] = &named.segments[..]
                && ["f32", "f64", "f32x8", "f64x4"].contains(&of.as_str())
                && LOOSE.contains(&name.as_str())
            {
                found.push((name.clone(), named.line));
            }
        }
        for (name, line) in found {
            let text = format!("{name} is rounded as the machine likes");
            offences.push(Offence::new(path, line, text));
        }
    }
    offences
}

/// Calls of loose methods, with their lines.
fn methods(tokens: TokenStream) -> Vec<(String, usize)> {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut found = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        match token {
            TokenTree::Group(group) => found.extend(methods(group.stream())),
            TokenTree::Ident(name) => {
                let is_method = i > 0
                    && matches!(&tokens[i - 1], TokenTree::Punct(p) if p.as_char() == '.')
                    && matches!(tokens.get(i + 1), Some(TokenTree::Group(g)) if g.delimiter() == Delimiter::Parenthesis);
                if is_method && LOOSE.contains(&name.to_string().as_str()) {
                    found.push((name.to_string(), name.span().start().line));
                }
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(source: &str) -> Vec<String> {
        let tree = Tree::of(&[("x/src/lib.rs", source), ("y/src/lib.rs", "fn f() { 1.0.sin() }")]);
        check(&tree, &["x/src"]).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_rounded_alike_passes() {
        let source = "fn f(x: f64) -> f64 { libm::sin(x).sqrt() + x.abs() * self.exp + sin(x) }";
        assert!(told(source).is_empty());
    }

    #[test]
    fn loose_ones_are_told() {
        let sine = "x/src/lib.rs:2: sin is rounded as the machine likes";
        assert_eq!(told("fn f(x: f64) -> f64 {\n (x + 1.0).sin() }"), [sine]);
        assert_eq!(told("fn f() {\n g(|x| assert!(x.sin() > 0.0)) }"), [sine]);
        assert_eq!(told("fn f() {\n x.map(f64::sin) }"), [sine]);
    }
}
