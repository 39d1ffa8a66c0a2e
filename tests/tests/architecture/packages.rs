//! The packages of the tree and their targets, read from the manifests without Cargo.

use toml::{Table, Value};

use crate::tree::{Tree, folder, join};

/// A folder with a manifest of its own.
#[derive(Clone, Debug)]
pub(crate) struct Package {
    /// The folder, without a slash at its end.
    pub(crate) dir: String,
    pub(crate) name: String,
    pub(crate) dependencies: Vec<Dependency>,
    manifest: Table,
}

/// An entry of a manifest's dependencies.
#[derive(Clone, Debug)]
pub(crate) struct Dependency {
    /// The name of the crate at its registry, also where the manifest gives it another one.
    pub(crate) name: String,
    /// For a path dependency: the folder.
    pub(crate) dir: Option<String>,
    pub(crate) dev: bool,
    pub(crate) line: usize,
}

/// What Cargo can build by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Bin,
    Test,
    Bench,
    Example,
}

impl Kind {
    pub(crate) const ALL: [Self; 4] = [Self::Bin, Self::Test, Self::Bench, Self::Example];

    /// The name of the manifest's table and of the command line's option.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Bin => "bin",
            Self::Test => "test",
            Self::Bench => "bench",
            Self::Example => "example",
        }
    }

    fn folder(self) -> &'static str {
        match self {
            Self::Bin => "src/bin",
            Self::Test => "tests",
            Self::Bench => "benches",
            Self::Example => "examples",
        }
    }
}

impl Package {
    pub(crate) fn manifest_path(&self) -> String {
        within(&self.dir, "Cargo.toml")
    }

    /// The library's root file.
    pub(crate) fn library(&self, tree: &Tree) -> Option<String> {
        let path = within(&self.dir, "src/lib.rs");
        tree.has_file(&path).then_some(path)
    }

    /// Name and root file of each target of a kind: those named in the manifest, then those that
    /// Cargo finds by itself.
    pub(crate) fn targets(&self, tree: &Tree, kind: Kind) -> Vec<(String, String)> {
        let mut found = Vec::new();
        let tables = self.manifest.get(kind.key()).and_then(Value::as_array);
        for table in tables.into_iter().flatten() {
            let Some(name) = table.get("name").and_then(Value::as_str) else { continue };
            let path = table.get("path").and_then(Value::as_str).map_or_else(
                || format!("{}/{name}.rs", kind.folder()),
                |path| path.trim_start_matches("./").to_owned(),
            );
            found.push((name.to_owned(), within(&self.dir, &path)));
        }
        let prefix = within(&self.dir, &format!("{}/", kind.folder()));
        for path in tree.paths().filter(|path| path.starts_with(&prefix)) {
            let rest = &path[prefix.len()..];
            let name = match rest.strip_suffix("/main.rs") {
                Some(name) => name,
                None => rest.strip_suffix(".rs").unwrap_or("/"),
            };
            if !name.contains('/') && found.iter().all(|(_, known)| known != path) {
                found.push((name.to_owned(), path.to_owned()));
            }
        }
        let main = within(&self.dir, "src/main.rs");
        if kind == Kind::Bin && tree.has_file(&main) && found.iter().all(|(_, f)| *f != main) {
            found.push((self.name.clone(), main));
        }
        found
    }

    /// The root files of all targets.
    pub(crate) fn roots(&self, tree: &Tree) -> Vec<String> {
        let named = Kind::ALL.iter().flat_map(|&kind| self.targets(tree, kind));
        let mut roots: Vec<String> = self.library(tree).into_iter().collect();
        roots.extend(named.map(|(_, path)| path));
        roots
    }
}

/// Every package of the tree, by folder.
pub(crate) fn packages(tree: &Tree) -> Vec<Package> {
    let shared = tree.text("Cargo.toml").map(parse).unwrap_or_default();
    let shared = shared.get("workspace").and_then(|w| w.get("dependencies"));
    let shared = shared.and_then(Value::as_table).cloned().unwrap_or_default();
    let mut found = Vec::new();
    for (path, text) in tree.with_extension("toml") {
        if !(path == "Cargo.toml" || path.ends_with("/Cargo.toml")) {
            continue;
        }
        let manifest = parse(text);
        let Some(name) = manifest.get("package").and_then(|p| p.get("name")?.as_str()) else {
            continue;
        };
        let dir = folder(path).to_owned();
        let dependencies = dependencies(&dir, text, &manifest, &shared);
        found.push(Package { name: name.to_owned(), dependencies, dir, manifest });
    }
    found
}

/// The package that a file belongs to: the one with the deepest folder.
pub(crate) fn package_of<'a>(packages: &'a [Package], path: &str) -> Option<&'a Package> {
    packages
        .iter()
        .filter(|package| is_within(path, &package.dir))
        .max_by_key(|package| package.dir.len())
}

/// Whether a path is a folder or lies in it.
fn is_within(path: &str, dir: &str) -> bool {
    dir.is_empty() || path.strip_prefix(dir).is_some_and(|r| r.is_empty() || r.starts_with('/'))
}

fn within(dir: &str, path: &str) -> String {
    if dir.is_empty() { path.to_owned() } else { format!("{dir}/{path}") }
}

fn parse(text: &str) -> Table {
    text.parse().unwrap_or_else(|e| panic!("a manifest that cannot be read: {e}\n{text}"))
}

fn dependencies(dir: &str, text: &str, manifest: &Table, shared: &Table) -> Vec<Dependency> {
    let mut places = vec![manifest];
    let targets = manifest.get("target").and_then(Value::as_table);
    places.extend(targets.into_iter().flat_map(Table::values).filter_map(Value::as_table));
    let mut found = Vec::new();
    for place in places {
        for key in ["dependencies", "build-dependencies", "dev-dependencies"] {
            let table = place.get(key).and_then(Value::as_table);
            for (name, value) in table.into_iter().flatten() {
                let is_shared = value.get("workspace").and_then(Value::as_bool) == Some(true);
                let (base, value) =
                    if is_shared { ("", shared.get(name)) } else { (dir, Some(value)) };
                let text_of = |key: &str| value.and_then(|v| v.get(key)?.as_str());
                found.push(Dependency {
                    name: text_of("package").unwrap_or(name).to_owned(),
                    dir: text_of("path").and_then(|path| join(base, path)),
                    dev: key == "dev-dependencies",
                    line: line_of(text, name, key),
                });
            }
        }
    }
    found
}

/// The line on which a dependency stands; else that of the section, else the first.
fn line_of(text: &str, name: &str, key: &str) -> usize {
    let mut section = 1;
    let mut inside = false;
    for (line, number) in text.lines().zip(1..) {
        if let Some(header) = line.trim().strip_prefix('[') {
            let header = header.trim_end_matches(']');
            let is = |key: &str| header == key || header.ends_with(&format!(".{key}"));
            if is(&format!("{key}.{name}")) {
                return number;
            }
            inside = is(key);
            section = if inside { number } else { section };
        } else if inside && line.trim().split(['.', '=', ' ']).next() == Some(name) {
            return number;
        }
    }
    section
}

#[test]
fn manifests_are_read() {
    let tree = Tree::of(&[
        ("Cargo.toml", "[workspace.dependencies]\nlow = { path = \"low\" }\nserde = \"1\"\n"),
        ("low/Cargo.toml", "[package]\nname = \"low\"\n"),
        (
            "up/Cargo.toml",
            "[package]\nname = \"up\"\n[[bin]]\nname = \"go\"\npath = \"src/main.rs\"\n\
             [dependencies]\nserde.workspace = true\n[dev-dependencies]\nlow.workspace = true\n",
        ),
        ("up/src/main.rs", ""),
        ("up/tests/one.rs", ""),
        ("up/tests/two/main.rs", ""),
        ("up/tests/two/part.rs", ""),
    ]);
    let packages = packages(&tree);
    let up = packages.iter().find(|package| package.name == "up").expect("up");
    let low = up.dependencies.iter().find(|d| d.name == "low").expect("low");
    assert_eq!((low.dir.as_deref(), low.dev, low.line), (Some("low"), true, 9));
    assert_eq!(up.targets(&tree, Kind::Bin), [("go".to_owned(), "up/src/main.rs".to_owned())]);
    let tests: Vec<_> = up.targets(&tree, Kind::Test).into_iter().map(|(name, _)| name).collect();
    assert_eq!(tests, ["one", "two"]);
    assert_eq!(package_of(&packages, "up/tests/one.rs").map(|p| p.name.as_str()), Some("up"));
}
