//! Libraries of others, kept from taking the program down.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use super::error::{Malformed, Place, malformed};

thread_local! {
    /// Whether this thread is within [`guarded`]: what it panics with is told as an error.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What a library of others makes of a file. Not all of them are written for files that lie about
/// themselves: where one gives up by a panic, the file is malformed, and that is all that is said of
/// it. Panics elsewhere are told as before, by the hook that was there at the first call.
pub(super) fn guarded<T>(read: impl FnOnce() -> Result<T, Malformed>) -> Result<T, Malformed> {
    static HUSHED: Once = Once::new();
    HUSHED.call_once(|| {
        let told = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if !GUARDED.try_with(Cell::get).unwrap_or(false) {
                told(panic);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let found = catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(outer);
    found.unwrap_or_else(|_| {
        malformed(Place::File, "it says of itself what is not so: the reader of its format gave up")
    })
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    const ALONE: &str = "NULLSWEEP_TEST_GUARDED";

    /// In a process of its own: what a hook prints goes to standard error.
    #[test]
    fn a_reader_that_gives_up_says_nothing_and_others_go_on_to() {
        if std::env::var_os(ALONE).is_some() {
            let found: Result<(), _> = guarded(|| {
                let _ = guarded(|| -> Result<(), Malformed> { panic!("hushed within") });
                panic!("hushed without")
            });
            assert!(found.is_err_and(|e| e.cause.ends_with("gave up")));
            assert_eq!(guarded(|| Ok(7)), Ok(7));
            catch_unwind(|| panic!("told later")).expect_err("a panic");
            return;
        }
        let itself = std::env::current_exe().expect("this test");
        let name = "scan::guarded::tests::a_reader_that_gives_up_says_nothing_and_others_go_on_to";
        let mut again = Command::new(itself);
        again.args(["--exact", name, "--nocapture"]).env(ALONE, "1");
        let done = again.output().expect("it starts");
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.success(), "{said}");
        assert!(!said.contains("hushed") && said.contains("told later"), "{said}");
    }
}
