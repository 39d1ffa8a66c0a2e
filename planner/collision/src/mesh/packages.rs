//! Where ROS packages are on this machine.

use std::collections::BTreeMap;
use std::env;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Folders in which packages are looked for, one kind of place after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Packages {
    /// Those whose folder is given.
    given: BTreeMap<String, PathBuf>,
    places: Vec<Place>,
}

/// One kind of place.
#[derive(Clone, Debug)]
struct Place {
    /// As in "looked …".
    name: String,
    /// Each may be the package's own folder or the one that it is in.
    folders: Vec<PathBuf>,
}

/// How deep packages may lie below a folder of ROS_PACKAGE_PATH.
const DEPTH: usize = 3;

impl Packages {
    /// Those that are given, and no others.
    pub(super) fn given(given: BTreeMap<String, PathBuf>) -> Self {
        Self { given, places: Vec::new() }
    }

    /// Those that are given, and others beside a URDF, where ROS says, and in Python's packages.
    pub(super) fn of_machine(urdf_folder: &Path, given: BTreeMap<String, PathBuf>) -> Self {
        let folder = urdf_folder.canonicalize().unwrap_or_else(|_| urdf_folder.into());
        let beside = folder.ancestors().filter(|a| a.parent().is_some());
        let mut packages = Self::given(given);
        packages.add(format!("beside the URDF ({} and above)", folder.display()), beside);
        let ament = variable("AMENT_PREFIX_PATH").map(|prefix| prefix.join("share"));
        packages.add(named("AMENT_PREFIX_PATH"), ament);
        let ros = variable("ROS_PACKAGE_PATH").flat_map(|root| below(&root, DEPTH));
        packages.add(named("ROS_PACKAGE_PATH"), ros);
        let python = python();
        let name = if python.is_empty() {
            "in no Python package (no site-packages found)".into()
        } else {
            let mut name = String::from("in Python's packages (");
            for (i, site) in python.iter().enumerate() {
                let comma = if i == 0 { "" } else { ", " };
                let _ = write!(name, "{comma}{}", site.display());
            }
            name + ")"
        };
        packages.add(name, python.iter().flat_map(|site| shares(site)));
        packages
    }

    fn add(&mut self, name: String, folders: impl IntoIterator<Item = impl Into<PathBuf>>) {
        let folders = folders.into_iter().map(Into::into).collect();
        self.places.push(Place { name, folders });
    }

    /// The folder of a package that has such a file, and the kind of place that it was found in
    /// where it was not given.
    pub(super) fn find(&self, package: &str, file: &str) -> Option<(PathBuf, Option<&str>)> {
        if let Some(folder) = self.given.get(package) {
            return Some((folder.clone(), None));
        }
        self.places.iter().find_map(|place| {
            let folders = place.folders.iter().flat_map(|folder| {
                let is_it = folder.file_name().is_some_and(|name| name == package);
                is_it.then(|| folder.clone()).into_iter().chain([folder.join(package)])
            });
            let folder = folders.into_iter().find(|folder| folder.join(file).is_file())?;
            Some((folder, Some(&*place.name)))
        })
    }

    /// Where packages are looked for, in words.
    pub(super) fn looked(&self) -> String {
        let mut places = self.places.iter().map(|place| &*place.name);
        let Some(first) = places.next() else { return "nowhere else".into() };
        places.fold(first.to_owned(), |all, place| all + ", " + place)
    }
}

/// The folders that a variable of the environment names.
fn variable(name: &str) -> impl Iterator<Item = PathBuf> {
    let folders: Vec<PathBuf> = env::var_os(name)
        .map(|value| env::split_paths(&value).filter(|p| !p.as_os_str().is_empty()).collect())
        .unwrap_or_default();
    folders.into_iter()
}

/// "in …", with whether it is set.
fn named(variable: &str) -> String {
    match env::var(variable) {
        Ok(value) if !value.is_empty() => format!("in {variable} ({value})"),
        _ => format!("in {variable} (not set)"),
    }
}

/// A folder and those below it, in order; not below packages, and nothing that is hidden.
fn below(folder: &Path, depth: usize) -> Vec<PathBuf> {
    let mut found = vec![folder.to_path_buf()];
    if depth > 0 && !folder.join("package.xml").is_file() {
        found.extend(folders(folder).iter().flat_map(|inner| below(inner, depth - 1)));
    }
    found
}

/// The folders in a folder, in order.
fn folders(folder: &Path) -> Vec<PathBuf> {
    let is_hidden = |path: &PathBuf| {
        path.file_name().is_none_or(|name| name.to_string_lossy().starts_with('.'))
    };
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir() && !is_hidden(path))
        .collect();
    found.sort();
    found
}

/// The `site-packages` of the Pythons that are active or on the path.
fn python() -> Vec<PathBuf> {
    let active = ["VIRTUAL_ENV", "CONDA_PREFIX"].map(variable).into_iter().flatten();
    let on_path = variable("PATH")
        .filter(|bin| bin.join("python3").exists())
        .filter_map(|bin| Some(bin.parent()?.to_path_buf()));
    let user = variable("HOME").map(|home| home.join(".local"));
    let mut found = Vec::new();
    for prefix in active.chain(user).chain(on_path) {
        for lib in folders(&prefix.join("lib")) {
            let is_python =
                lib.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"));
            let sites = ["site-packages", "dist-packages"].map(|site| lib.join(site));
            found.extend(sites.into_iter().filter(|site| is_python && site.is_dir()));
        }
    }
    let mut seen = std::collections::HashSet::new();
    found.retain(|site| seen.insert(site.clone()));
    found
}

/// Where packages are in a `site-packages`: there, and where cmeel and plain data files put what a
/// prefix has under `share`; `example-robot-data` has its robots' packages in a folder of its own.
fn shares(site: &Path) -> Vec<PathBuf> {
    let cmeel = site.join("cmeel.prefix/share");
    let robots = folders(&cmeel).into_iter().map(|package| package.join("robots"));
    let prefix = site.ancestors().nth(3).map(|prefix| prefix.join("share"));
    let robots: Vec<_> = robots.filter(|robots| robots.is_dir()).collect();
    [site.to_path_buf(), cmeel].into_iter().chain(robots).chain(prefix).collect()
}
