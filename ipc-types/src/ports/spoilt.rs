//! Files of iceoryx2's that nobody can use: half made by a process that died, or written to by
//! another user.
//!
//! iceoryx2 0.10 waits without end on a segment of length 0, so they are looked for beforehand.
//! The node counter is a segment that every process opens while it makes its node, and never
//! after; iceoryx2 lets every user of the machine write to it.

use std::fs::{self, DirEntry, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use super::owner::User;

/// Where segments lie.
const SEGMENTS: &str = "/dev/shm";
/// How the name of a node counter ends.
const COUNTER: &str = ".global_mgmt";

/// A file that must go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Spoilt {
    pub(super) file: PathBuf,
    pub(super) owner: User,
}

/// A segment of length 0 among those of a system.
pub(super) fn empty(prefix: &str) -> Option<Spoilt> {
    first(Path::new(SEGMENTS), |name, length| name.starts_with(prefix) && length == 0)
}

/// A system's node counter.
pub(super) fn counter(prefix: &str) -> Option<Spoilt> {
    first(Path::new(SEGMENTS), |name, _| name.starts_with(prefix) && name.ends_with(COUNTER))
}

/// Keeps other users from a system's node counter. Where it is another user's it stays as it is.
pub(super) fn keep_counter(prefix: &str) {
    if let Some(counter) = counter(prefix) {
        let _ = fs::set_permissions(counter.file, Permissions::from_mode(0o600));
    }
}

fn first(folder: &Path, is_it: impl Fn(&str, u64) -> bool) -> Option<Spoilt> {
    let spoilt = |entry: DirEntry| {
        let facts = entry.metadata().ok().filter(fs::Metadata::is_file)?;
        let found = is_it(&entry.file_name().to_string_lossy(), facts.len());
        found.then(|| Spoilt { file: entry.path(), owner: User { uid: facts.uid() } })
    };
    // The same one is named every time.
    let all = fs::read_dir(folder).ok()?.filter_map(Result::ok).filter_map(spoilt);
    all.min_by(|a, b| a.file.cmp(&b.file))
}
