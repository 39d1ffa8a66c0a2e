//! Progress bars.

use std::sync::{Arc, Mutex};

use indicatif::{ProgressBar, ProgressStyle};
use nullsweep_planner::progress::Progress;

use crate::output::complain;

/// Shows each stage's progress on standard error, if that is a terminal; or tells it a listener.
pub(super) struct Bars {
    bar: Mutex<ProgressBar>,
    listener: Option<Arc<dyn Progress + Send>>,
    /// Notes that were told.
    told: Mutex<Vec<String>>,
}

impl Bars {
    pub(super) fn new() -> Self {
        Self { bar: Mutex::new(ProgressBar::hidden()), listener: None, told: Mutex::default() }
    }

    /// Nothing is shown: another one is told.
    pub(super) fn of(listener: Arc<dyn Progress + Send>) -> Self {
        Self { listener: Some(listener), ..Self::new() }
    }

    pub(super) fn clear(&self) {
        self.with(ProgressBar::finish_and_clear);
    }

    fn with(&self, act: impl FnOnce(&ProgressBar)) {
        if let Ok(bar) = self.bar.lock() {
            act(&bar);
        }
    }
}

impl Progress for Bars {
    fn stage(&self, name: &'static str, total: Option<usize>) {
        if let Some(listener) = &self.listener {
            return listener.stage(name, total);
        }
        let (bar, template) = match total {
            Some(n) => (ProgressBar::new(n as u64), "{msg:<28} {wide_bar} {pos}/{len} {elapsed}"),
            None => (ProgressBar::new_spinner(), "{msg:<28} {spinner} {elapsed}"),
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(name);
        bar.enable_steady_tick(std::time::Duration::from_millis(100));
        if let Ok(mut shown) = self.bar.lock() {
            shown.finish_and_clear();
            *shown = bar;
        }
    }

    fn tick(&self) {
        if let Some(listener) = &self.listener {
            return listener.tick();
        }
        self.with(|bar| bar.inc(1));
    }

    /// A note is told once.
    fn note(&self, text: &str) {
        if let Ok(mut told) = self.told.lock() {
            if told.iter().any(|one| one == text) {
                return;
            }
            told.push(text.to_owned());
        }
        if let Some(listener) = &self.listener {
            return listener.note(text);
        }
        self.with(|bar| bar.suspend(|| complain!("note: {text}")));
    }
}
