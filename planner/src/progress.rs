//! What long work tells about itself.

/// A listener to the planner's progress. All calls may come from several threads.
pub trait Progress: Sync {
    /// A stage begins; `total` ticks will come, if known.
    fn stage(&self, name: &'static str, total: Option<usize>);
    /// One unit of the present stage is done.
    fn tick(&self);
    /// Something that a person should know.
    fn note(&self, text: &str);
}

/// Most numbers that a note lists.
const LISTED: usize = 8;

/// Things that are left out for one reason, in one line, the first ones by their numbers.
#[must_use]
pub fn left_out([thing, things]: [&str; 2], which: &[usize], why: &str) -> String {
    let numbers: Vec<String> = which.iter().take(LISTED).map(ToString::to_string).collect();
    let numbers = numbers.join(", ");
    match which.len() {
        1 => format!("{thing} {numbers} (from 0 on) is left out: {why}"),
        n if n <= LISTED => format!("{n} {things} are left out ({numbers}, from 0 on): {why}"),
        n => format!("{n} {things} are left out ({numbers}, …, from 0 on): {why}"),
    }
}

/// Nobody listens.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str, _: Option<usize>) {}
    fn tick(&self) {}
    fn note(&self, _: &str) {}
}

#[test]
fn many_are_told_in_one_line() {
    assert_eq!(left_out(["patch", "patches"], &[7], "why"), "patch 7 (from 0 on) is left out: why");
    assert_eq!(
        left_out(["pose", "poses"], &[1, 2], "why"),
        "2 poses are left out (1, 2, from 0 on): why"
    );
    let many: Vec<usize> = (0..50).collect();
    let text = left_out(["pose", "poses"], &many, "why");
    assert_eq!(text, "50 poses are left out (0, 1, 2, 3, 4, 5, 6, 7, …, from 0 on): why");
}
