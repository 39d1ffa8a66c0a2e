//! Files that a command is to write: whether that goes is known before the work.

use std::fs::OpenOptions;
use std::path::Path;

use anyhow::Context;

/// Whether a file can be written there, told before the work that it is to hold. What is there is left
/// as it is.
///
/// # Errors
/// Names the file.
pub(super) fn writable(path: &Path) -> anyhow::Result<()> {
    if path == Path::new("-") {
        return Ok(());
    }
    let is_new = !path.exists();
    let opened = OpenOptions::new().append(true).create(true).open(path);
    opened.with_context(|| format!("cannot write {}", path.display()))?;
    if is_new {
        std::fs::remove_file(path).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_stays_and_what_is_not_is_not_made() {
        let folder = tempfile::tempdir().expect("a folder");
        let (old, new) = (folder.path().join("old"), folder.path().join("new"));
        std::fs::write(&old, "kept").expect("written");
        writable(&old).expect("a file");
        writable(&new).expect("a file");
        writable("-".as_ref()).expect("standard output");
        assert_eq!(std::fs::read(&old).expect("a file"), b"kept");
        assert!(!new.exists());
        let nowhere = folder.path().join("no/such/folder");
        let error = writable(&nowhere).expect_err("no folder").to_string();
        assert!(error.contains("no/such/folder"), "{error}");
        writable(folder.path()).expect_err("a folder is no file");
    }
}
