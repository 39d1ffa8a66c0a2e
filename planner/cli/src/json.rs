//! Figures for machines.

use std::path::Path;

use anyhow::Context;
use serde::Serialize;

use crate::output::say;

/// Writes pretty JSON to a file, or to standard output for `-`.
pub(super) fn write_json<T: Serialize>(value: &T, to: &Path) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value)?;
    if to == Path::new("-") {
        say!("{text}");
        return Ok(());
    }
    std::fs::write(to, text + "\n").with_context(|| format!("cannot write {}", to.display()))
}
