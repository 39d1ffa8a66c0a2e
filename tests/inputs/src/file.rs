//! Bytes as a file in memory, for what reads files by their path.

use std::cell::RefCell;
use std::fs::File;
use std::io::{Seek, Write};
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

use rustix::fs::{MemfdFlags, memfd_create};

thread_local! {
    static FILE: RefCell<File> = RefCell::new(
        memfd_create("nullsweep-input", MemfdFlags::CLOEXEC).expect("memory for a file").into(),
    );
}

thread_local! {
    static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("a folder for names");
}

/// As [`with`], where the path's ending says what the file is.
pub(crate) fn with_ending<T>(bytes: &[u8], ending: &str, read: impl FnOnce(&Path) -> T) -> T {
    with(bytes, |path| {
        FOLDER.with(|folder| {
            let name = folder.path().join(format!("input.{ending}"));
            if !name.is_symlink() {
                std::os::unix::fs::symlink(path, &name).expect("a name for a file in memory");
            }
            read(&name)
        })
    })
}

/// Calls `read` with the path of a file that holds these bytes.
pub(crate) fn with<T>(bytes: &[u8], read: impl FnOnce(&Path) -> T) -> T {
    FILE.with_borrow_mut(|file| {
        file.set_len(0).and_then(|()| file.rewind()).expect("a file in memory is emptied");
        file.write_all(bytes).expect("a file in memory is written");
        read(&PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd())))
    })
}
