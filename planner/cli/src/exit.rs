//! Exit codes.

/// Everything went well.
pub const OK: u8 = 0;
/// Bad input, no plan, no executor, a rejection.
pub const FAILED: u8 = 1;
/// The command line was wrong (clap's own code).
pub const USAGE: u8 = 2;
/// A plan was made but breaks a rule, so it was not written.
pub const VIOLATIONS: u8 = 3;
