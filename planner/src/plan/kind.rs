//! Which kind of file a text is.

use serde::Deserialize;

/// Whether a text is a program of several plans rather than one.
pub(super) fn is_program(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Probe {
        program: Option<u32>,
    }
    serde_json::from_str::<Probe>(text).is_ok_and(|probe| probe.program.is_some())
}
