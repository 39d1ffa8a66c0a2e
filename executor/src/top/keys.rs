//! What a key asks for.

use nullsweep_ipc_types::CommandKind;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// How much a key changes the speed scale.
const STEP: f64 = 0.1;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Deed {
    /// A command.
    Command(CommandKind),
    /// Another speed scale, by so much.
    Speed(f64),
    /// The end of the screen. The executor runs on.
    Quit,
}

/// The scale that is asked for where it is to be so much faster.
pub(super) fn faster(scale: f64, by: f64) -> f64 {
    let asked = scale + by;
    // Also for a NaN off the wire.
    if asked > 0.0 { asked.min(1.0) } else { 0.0 }
}

/// What a key means, if anything.
pub(super) fn deed(key: KeyEvent) -> Option<Deed> {
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    Some(match key.code {
        KeyCode::Char('c') if control => Deed::Quit,
        KeyCode::Char('s' | ' ') => Deed::Command(CommandKind::Stop),
        // A hand that means the terminal (Ctrl-R, Ctrl-D) must not move an arm: it can only stop it.
        _ if !KeyModifiers::SHIFT.contains(key.modifiers) => return None,
        KeyCode::Char('q') | KeyCode::Esc => Deed::Quit,
        KeyCode::Char('p') => Deed::Command(CommandKind::Pause),
        KeyCode::Char('r') => Deed::Command(CommandKind::Resume),
        KeyCode::Char('d') => Deed::Command(CommandKind::StopAndDisable),
        KeyCode::Char('x') => Deed::Command(CommandKind::Reset),
        KeyCode::Char('+' | '=') => Deed::Speed(STEP),
        KeyCode::Char('-') => Deed::Speed(-STEP),
        _ => return None,
    })
}
