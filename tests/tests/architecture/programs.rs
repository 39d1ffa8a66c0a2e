//! The subcommands of a program, read from the enums that `clap` makes them of.

use std::collections::BTreeMap;

use syn::{Attribute, Fields, GenericArgument, Item, Meta, PathArguments, Type};

use crate::modules::{attributes, parse};
use crate::packages::{Kind, Package};
use crate::tree::Tree;

/// The subcommands below a program or a subcommand, by name; empty where there are none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Commands(BTreeMap<String, Self>);

/// What the sources of one package say.
#[derive(Default)]
struct Declared {
    /// Of each enum of subcommands: the names, and the type that holds what follows.
    enums: BTreeMap<String, Vec<(String, Option<String>)>>,
    /// Of each struct of arguments: the enum of its subcommands.
    below: BTreeMap<String, String>,
    /// The structs that a whole command line is parsed into.
    roots: Vec<String>,
}

impl Commands {
    /// The subcommands of a program; `None` where no package has a program of that name.
    pub(crate) fn of(tree: &Tree, packages: &[Package], program: &str) -> Option<Self> {
        let has = |package: &&Package| {
            package.targets(tree, Kind::Bin).iter().any(|(name, _)| name == program)
        };
        let package = packages.iter().find(has)?;
        let sources = format!("{}/src/", package.dir);
        let mut declared = Declared::default();
        for (path, text) in tree.with_extension("rs").filter(|(p, _)| p.starts_with(&sources)) {
            parse(path, text).items.iter().for_each(|item| declared.read(item));
        }
        let mut commands = Self::default();
        for root in &declared.roots {
            commands.0.extend(declared.commands(root, 0).0);
        }
        Some(commands)
    }

    /// The first of these words that should be a subcommand and is none.
    pub(crate) fn unknown<'a>(&self, words: &[&'a str]) -> Option<&'a str> {
        let (word, rest) = words.split_first()?;
        if self.0.is_empty() || !is_word(word) {
            return None;
        }
        let unknown = word.split('|').find(|word| !self.0.contains_key(*word));
        unknown.or_else(|| self.0.get(*word).and_then(|below| below.unknown(rest)))
    }
}

/// Whether this looks like a subcommand, or several with strokes between them: no option, no
/// placeholder, no file.
fn is_word(word: &str) -> bool {
    let letters = |part: &str| {
        part.starts_with(|c: char| c.is_ascii_lowercase())
            && part.chars().all(|c| c.is_ascii_lowercase() || c == '-')
    };
    word.split('|').all(letters)
}

impl Declared {
    fn read(&mut self, item: &Item) {
        let attributes = attributes(item);
        match item {
            Item::Enum(item) if derives(attributes, "Subcommand") => {
                let variants = item.variants.iter().map(|variant| {
                    let name = given_name(&variant.attrs);
                    let name = name.unwrap_or_else(|| kebab(&variant.ident.to_string()));
                    (name, payload(&variant.fields))
                });
                self.enums.insert(item.ident.to_string(), variants.collect());
            }
            Item::Struct(item) => {
                let name = item.ident.to_string();
                if derives(attributes, "Parser") {
                    self.roots.push(name.clone());
                }
                for field in &item.fields {
                    if says(&field.attrs, "subcommand")
                        && let Some(of) = type_name(&field.ty)
                    {
                        self.below.insert(name.clone(), of);
                    }
                }
            }
            _ => {}
        }
    }

    fn commands(&self, arguments: &str, depth: usize) -> Commands {
        let variants = self.below.get(arguments).and_then(|name| self.enums.get(name));
        let mut commands = Commands::default();
        for (name, payload) in variants.into_iter().flatten().filter(|_| depth < 4) {
            let below = payload.as_ref().map(|payload| self.commands(payload, depth + 1));
            commands.0.insert(name.clone(), below.unwrap_or_default());
        }
        commands
    }
}

fn derives(attributes: &[Attribute], name: &str) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("derive")
            && matches!(&attribute.meta, Meta::List(list) if has_word(&list.tokens.to_string(), name))
    })
}

/// Whether a `command` attribute has this word.
fn says(attributes: &[Attribute], word: &str) -> bool {
    attributes.iter().any(|attribute| {
        let ours = attribute.path().is_ident("command") || attribute.path().is_ident("clap");
        ours && matches!(&attribute.meta, Meta::List(list) if has_word(&list.tokens.to_string(), word))
    })
}

fn has_word(text: &str, word: &str) -> bool {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|part| part == word)
}

/// The name that `#[command(name = "…")]` gives.
fn given_name(attributes: &[Attribute]) -> Option<String> {
    let lists = attributes.iter().filter(|a| a.path().is_ident("command"));
    let texts = lists.filter_map(|attribute| match &attribute.meta {
        Meta::List(list) => Some(list.tokens.to_string()),
        _ => None,
    });
    texts.filter_map(|text| Some(text.split("name = \"").nth(1)?.split('"').next()?.into())).next()
}

/// The type in a variant's parentheses.
fn payload(fields: &Fields) -> Option<String> {
    match fields {
        Fields::Unnamed(fields) => type_name(&fields.unnamed.first()?.ty),
        _ => None,
    }
}

/// The last name of a type's path, without a box or an option around it.
fn type_name(ty: &Type) -> Option<String> {
    let Type::Path(path) = ty else { return None };
    let last = path.path.segments.last()?;
    if let PathArguments::AngleBracketed(inner) = &last.arguments
        && let Some(GenericArgument::Type(inner)) = inner.args.first()
    {
        return type_name(inner);
    }
    Some(last.ident.to_string())
}

fn kebab(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !text.is_empty() {
            text.push('-');
        }
        text.extend(c.to_lowercase());
    }
    text
}

#[test]
fn subcommands_are_read() {
    let main = "#[derive(Debug, Parser)] struct Cli { #[command(subcommand)] c: Command }\n\
        #[derive(Subcommand)] enum Command { Plan(Box<a::PlanArgs>), DryRun { x: u8 }, Ctl(Ctl) }\n\
        #[derive(Args)] struct Ctl { #[command(subcommand)] order: Order }\n\
        #[derive(Subcommand)] enum Order { Stop, #[command(name = \"go\")] Resume }";
    let tree = Tree::of(&[("x/Cargo.toml", "[package]\nname = \"x\"\n"), ("x/src/main.rs", main)]);
    let packages = crate::packages::packages(&tree);
    assert_eq!(Commands::of(&tree, &packages, "y"), None);
    let commands = Commands::of(&tree, &packages, "x").expect("the program");
    let unknown = |line: &'static str| commands.unknown(&line.split(' ').collect::<Vec<_>>());
    assert_eq!(unknown("plan scan.pcd"), None);
    assert_eq!(unknown("dry-run x"), None);
    assert_eq!(unknown("--help"), None);
    assert_eq!(unknown("SUBCOMMAND"), None);
    assert_eq!(unknown("ctl stop|go"), None);
    assert_eq!(unknown("ctl stop|resume"), Some("resume"));
    assert_eq!(unknown("paln scan.pcd"), Some("paln"));
}
