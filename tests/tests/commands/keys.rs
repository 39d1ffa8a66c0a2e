//! The keys of a file, read from the struct that it is read into.

use std::fmt::Write as _;

use syn::{Expr, ExprLit, Fields, GenericArgument, Item, Lit, Meta, PathArguments, Type};

/// A table of each struct of these names, in their order, in Markdown. `name`: the heading of a struct.
pub(crate) fn tables(source: &str, structs: &[(&str, &str)]) -> String {
    let file = syn::parse_file(source).expect("a source");
    let mut text = String::new();
    for (name, heading) in structs {
        let found = file.items.iter().find_map(|item| match item {
            Item::Struct(item) if item.ident == name => Some(item),
            _ => None,
        });
        let Some(Fields::Named(fields)) = found.map(|item| &item.fields) else {
            panic!("no struct {name}");
        };
        let _ = write!(text, "### {heading}\n\n| key | what it holds | |\n|---|---|---|\n");
        for field in &fields.named {
            let Some(key) = &field.ident else { continue };
            let kind = kind(&field.ty);
            if !kind.is_empty() {
                let _ = writeln!(text, "| `{key}` | {kind} | {} |", told(&field.attrs));
            }
        }
        text.push('\n');
    }
    text
}

/// What a field's comment says.
fn told(attributes: &[syn::Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(said) if said.path.is_ident("doc") => match &said.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value()),
            _ => None,
        },
        _ => None,
    });
    let text = lines.map(|line| line.trim().to_owned()).collect::<Vec<_>>().join(" ");
    text.replace("\\[", "[").replace("\\]", "]").replace('|', "\\|")
}

/// What a type is to somebody who writes the file; empty: a table of its own.
fn kind(ty: &Type) -> String {
    match ty {
        Type::Array(array) => {
            let Expr::Lit(ExprLit { lit: Lit::Int(count), .. }) = &array.len else {
                panic!("an array of a known length");
            };
            format!("list of {count} numbers")
        }
        Type::Path(path) => {
            let last = path.path.segments.last().expect("a name");
            let inner: Vec<&Type> = match &last.arguments {
                PathArguments::AngleBracketed(inner) => inner.args.iter().filter_map(of).collect(),
                _ => Vec::new(),
            };
            match (last.ident.to_string().as_str(), &inner[..]) {
                ("Option", [inner]) => kind(inner),
                ("Vec", [inner]) => format!("list of {}s", kind(inner)),
                ("BTreeMap", [_, inner]) => format!("table, by name: {}", kind(inner)),
                ("String" | "Shape", _) => "text".into(),
                ("PathBuf", _) => "path".into(),
                ("f64", _) => "number".into(),
                ("u8" | "u32", _) => "whole number".into(),
                ("bool", _) => "`true` or `false`".into(),
                ("Limits" | "Scene" | "Executor", _) => String::new(),
                (other, _) => panic!("what is {other} to a user?"),
            }
        }
        _ => panic!("a type that a file can hold"),
    }
}

fn of(argument: &GenericArgument) -> Option<&Type> {
    match argument {
        GenericArgument::Type(ty) => Some(ty),
        _ => None,
    }
}

#[test]
fn keys_are_read() {
    let source = "/// A cell.\nstruct Cell {\n /// Name.\n /// And more. \\[m\\]\n pub a: Option<String>,\n\
        /// Here.\n b: BTreeMap<String, Vec<f64>>, c: Limits, /// Axis.\n d: [f64; 3] }";
    let expected = "### The cell\n\n| key | what it holds | |\n|---|---|---|\n\
        | `a` | text | Name. And more. [m] |\n\
        | `b` | table, by name: list of numbers | Here. |\n\
        | `d` | list of 3 numbers | Axis. |\n\n";
    assert_eq!(tables(source, &[("Cell", "The cell")]), expected);
}
