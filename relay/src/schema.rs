//! What both ends must have alike, as text that they exchange when they meet.

use nullsweep_ipc_types::ports::schema;
use xxhash_rust::xxh3::xxh3_64;

/// The version of what the two ends say to each other.
const RELAY: &str = "relay 1";

/// One end's schema: a line for each thing, `what: how`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema(String);

impl Schema {
    /// This build's.
    pub fn own() -> Self {
        let order = if cfg!(target_endian = "little") { "little" } else { "big" };
        let mut text = format!("protocol: {RELAY}\nbyte order: {order}-endian\n");
        for shape in schema() {
            text += &format!("{}: {} of {} bytes\n", shape.service, shape.name, shape.size);
        }
        Self(text)
    }

    /// What another end says its own is.
    pub fn read(text: &str) -> Self {
        Self(text.into())
    }

    pub fn text(&self) -> &str {
        &self.0
    }

    /// A number that other schemas do not have.
    pub fn seal(&self) -> u64 {
        xxh3_64(self.0.as_bytes())
    }

    /// Each line that only one of the two has; empty where they are alike.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let only = |one: &Self, other: &Self, place: &str| {
            let missing = |line: &&str| !other.0.lines().any(|o| o == *line);
            let lines: Vec<_> =
                one.0.lines().filter(missing).map(|line| format!("{line} {place}")).collect();
            lines
        };
        let mut all = only(self, other, "here");
        all.extend(only(other, self, "there"));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_type_or_size_is_told_from_both_sides() {
        let own = Schema::own();
        assert!(own.differences(&Schema::read(own.text())).is_empty());
        let other = own.text().replace("Telemetry.v5 of 1000", "Telemetry.v4 of 736");
        let other = Schema::read(&other);
        assert_ne!(own.seal(), other.seal());
        assert_eq!(
            own.differences(&other),
            [
                "telemetry: nullsweep.Telemetry.v5 of 1000 bytes here",
                "telemetry: nullsweep.Telemetry.v4 of 736 bytes there"
            ]
        );
        let text = own.text();
        for service in ["plan", "plan_event", "telemetry", "command"] {
            assert!(text.contains(&format!("\n{service}: nullsweep.")), "{text}");
        }
    }
}
