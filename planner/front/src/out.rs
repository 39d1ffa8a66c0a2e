//! What is written to standard output.

use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Writes to standard output; whoever has read enough has.
pub(crate) fn write_out(text: &[u8]) -> anyhow::Result<ExitCode> {
    match std::io::stdout().lock().write_all(text) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(ExitCode::SUCCESS),
    }
}
