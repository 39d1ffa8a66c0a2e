//! Paths among bare tokens: inside macros, where `syn` parses nothing.

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};
use syn::{Attribute, Meta};

/// A path as it is written, with its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PathAt {
    pub(crate) segments: Vec<String>,
    pub(crate) line: usize,
    /// Something that is no name follows behind its last `::`, as in `a::{b, c}`.
    pub(crate) open: bool,
}

/// The tokens of a file.
pub(crate) fn tokens(path: &str, text: &str) -> TokenStream {
    text.parse().unwrap_or_else(|e| panic!("{path}: not Rust: {e}"))
}

/// All paths of a token stream, groups included; fields, methods and lifetimes are none.
pub(crate) fn paths(tokens: TokenStream) -> Vec<PathAt> {
    let mut found = Vec::new();
    gather(tokens, &mut found);
    found
}

fn gather(tokens: TokenStream, found: &mut Vec<PathAt>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let is =
        |i: usize, c: char| matches!(tokens.get(i), Some(TokenTree::Punct(p)) if p.as_char() == c);
    let mut i = 0;
    while i < tokens.len() {
        match &tokens[i] {
            TokenTree::Group(group) => gather(group.stream(), found),
            TokenTree::Ident(first) => {
                let back = |n: usize, c: char| i >= n && is(i - n, c);
                let field = back(1, '.') && !back(2, '.');
                let continued = (back(1, ':') && back(2, ':')) || back(1, '\'');
                let line = first.span().start().line;
                let mut path = PathAt { segments: vec![first.to_string()], line, open: false };
                while is(i + 1, ':') && is(i + 2, ':') {
                    let Some(TokenTree::Ident(next)) = tokens.get(i + 3) else {
                        path.open = true;
                        break;
                    };
                    path.segments.push(next.to_string());
                    i += 3;
                }
                if !field && !continued {
                    found.push(path);
                }
            }
            _ => {}
        }
        i += 1;
    }
}

/// What an item macro seems to define: each bare name before a brace, with the brace's content.
pub(crate) fn defined_by_macro(tokens: TokenStream) -> Vec<(String, usize, Group)> {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut found = Vec::new();
    for pair in tokens.windows(2) {
        if let [TokenTree::Ident(name), TokenTree::Group(group)] = pair
            && group.delimiter() == Delimiter::Brace
        {
            found.push((name.to_string(), name.span().start().line, group.clone()));
        }
    }
    found
}

/// The names that stand first, and behind each comma, in an enum's brace.
pub(crate) fn variants(brace: &Group) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    let mut expected = true;
    for token in brace.stream() {
        match token {
            TokenTree::Punct(p) if p.as_char() == ',' => expected = true,
            TokenTree::Ident(name) if expected => {
                found.push((name.to_string(), name.span().start().line));
                expected = false;
            }
            _ => {}
        }
    }
    found
}

/// Whether an item is there in tests only.
pub(crate) fn only_in_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        if attribute.path().is_ident("test") {
            return true;
        }
        let Meta::List(list) = &attribute.meta else { return false };
        let condition = list.tokens.to_string().replace(' ', "");
        attribute.path().is_ident("cfg")
            && (condition == "test" || condition.starts_with("all(test,"))
    })
}

#[test]
fn paths_are_found_among_tokens() {
    let tokens = "f(a.b, 'x', 0..c, crate::d::e(&g)?); <T as U>::h; V::<W>::i".parse();
    let found: Vec<String> =
        paths(tokens.expect("tokens")).into_iter().map(|path| path.segments.join("::")).collect();
    assert_eq!(found, ["f", "a", "c", "crate::d::e", "g", "T", "as", "U", "V", "W"]);
}
