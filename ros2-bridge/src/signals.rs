//! Signals that end the program.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};

/// What is set once SIGINT or SIGTERM has come.
///
/// # Errors
/// They cannot be listened for.
pub fn done() -> io::Result<Arc<AtomicBool>> {
    let done = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&done))?;
    }
    Ok(done)
}
