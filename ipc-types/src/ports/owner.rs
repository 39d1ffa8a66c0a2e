//! Whose files a system's are: iceoryx2 keeps one user from another's and says only that
//! something failed.

use std::fmt;
use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::vec::Vec;

use rustix::fs::{Access, AtFlags, CWD, accessat};
use rustix::process::geteuid;

/// Most files that are looked at.
const MOST: usize = 10_000;
/// How deep below the root path iceoryx2's files lie, with room to spare.
const DEPTH: usize = 4;

/// A user of this machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct User {
    /// The user's number.
    pub uid: u32,
}

impl fmt::Display for User {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match name(&fs::read_to_string("/etc/passwd").unwrap_or_default(), self.uid) {
            Some(name) => write!(f, "{name} (uid {})", self.uid),
            None => write!(f, "uid {}", self.uid),
        }
    }
}

fn name(passwd: &str, uid: u32) -> Option<&str> {
    passwd.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(uid)).then_some(name)
    })
}

/// A file that stands in this process's way because it belongs to another user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Foreign {
    pub(super) file: PathBuf,
    pub(super) owner: User,
    pub(super) own: User,
}

/// The first file among a system's that another user has and this process may not read and write:
/// the root path (or, where it cannot be made, what it was to be made in), what lies below it,
/// and the segments of that prefix, if there is one, in `/dev/shm`. Nothing is in the superuser's way.
pub(super) fn foreign(root: &Path, prefix: Option<&str>) -> Option<Foreign> {
    let own = geteuid().as_raw();
    if own == 0 {
        return None;
    }
    let barred = |file: &Path| {
        let wanted = Access::READ_OK | Access::WRITE_OK;
        accessat(CWD, file, wanted, AtFlags::EACCESS).is_err()
    };
    first(root, prefix, own, &barred)
}

fn first(
    root: &Path,
    prefix: Option<&str>,
    own: u32,
    barred: &dyn Fn(&Path) -> bool,
) -> Option<Foreign> {
    let judged = |file: &Path, facts: &Metadata| {
        let owner = facts.uid();
        (owner != own && barred(file)).then(|| Foreign {
            file: file.to_path_buf(),
            owner: User { uid: owner },
            own: User { uid: own },
        })
    };
    // What cannot even be looked at is in a folder that can.
    let there = root.ancestors().find_map(|path| Some((path, path.metadata().ok()?)));
    let (place, facts) = there?;
    if let Some(foreign) = judged(place, &facts) {
        return Some(foreign);
    }
    let mut left = MOST;
    if place == root
        && let Some(foreign) = below(root, "", DEPTH, &mut left, &judged)
    {
        return Some(foreign);
    }
    below(Path::new("/dev/shm"), prefix?, 0, &mut left, &judged)
}

/// Looks at a folder's files that begin with `prefix`, and `depth` further down.
fn below(
    folder: &Path,
    prefix: &str,
    depth: usize,
    left: &mut usize,
    judged: &dyn Fn(&Path, &Metadata) -> Option<Foreign>,
) -> Option<Foreign> {
    let mut names: Vec<_> = fs::read_dir(folder).ok()?.filter_map(Result::ok).collect();
    names.retain(|entry| entry.file_name().to_string_lossy().starts_with(prefix));
    // The same one is named every time.
    names.sort_by_key(fs::DirEntry::file_name);
    for entry in names {
        *left = left.checked_sub(1)?;
        let (path, Ok(facts)) = (entry.path(), entry.metadata()) else { continue };
        let found = judged(&path, &facts).or_else(|| {
            let deeper = facts.is_dir() && depth > 0;
            deeper.then(|| below(&path, "", depth - 1, left, judged)).flatten()
        });
        if found.is_some() {
            return found;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_file_of_another_user_is_found() {
        let root = tempfile::TempDir::new().unwrap();
        let folder = root.path().join("nodes/one");
        fs::create_dir_all(&folder).unwrap();
        let file = folder.join("details");
        fs::write(&file, "x").unwrap();
        let own = geteuid().as_raw();
        assert_eq!(first(root.path(), None, own, &|_| true), None, "all are ours");
        // Seen by another user: the root path, or what may not be opened below it.
        let other = own + 1;
        let all = first(root.path(), None, other, &|_| true).unwrap();
        assert_eq!((all.file.as_path(), all.owner.uid), (root.path(), own));
        let deep = first(root.path(), None, other, &|path| path == file).unwrap();
        assert_eq!((deep.file, deep.own.uid), (file, other));
        // A folder that cannot be made: what it was to be made in.
        let missing = root.path().join("a/b");
        let above = first(&missing, None, other, &|_| true).unwrap();
        assert_eq!(above.file, root.path());
        assert_eq!(first(&missing, None, other, &|_| false), None);
    }

    #[test]
    fn users_have_names() {
        let passwd = "root:x:0:0:root:/root:/bin/sh\nbroken\nalice:x:1000:1000::/home/a:/bin/sh\n";
        assert_eq!(name(passwd, 1000), Some("alice"));
        assert_eq!(name(passwd, 1001), None);
    }
}
