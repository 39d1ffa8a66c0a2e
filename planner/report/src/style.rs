//! What the figures and the page share: colours, and text made safe for HTML.

/// Colours of planned motions, in turn: in contact, and in transfer.
pub(super) const MOTIONS: [(&str, &str); 3] =
    [("#12307a", "#8c9fd6"), ("#a3246e", "#e2a0c8"), ("#2b7a1f", "#a5d69c")];

/// Colours of measured motions, in turn.
pub(super) const MEASURED: [&str; 2] = ["#111111", "#7a5c00"];

/// Text as it may stand in HTML.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
