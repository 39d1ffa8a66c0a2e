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

/// Nobody listens.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str, _: Option<usize>) {}
    fn tick(&self) {}
    fn note(&self, _: &str) {}
}
