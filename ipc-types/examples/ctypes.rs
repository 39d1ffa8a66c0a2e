//! Writes the wire's types as Python ctypes structures, from the Rust sources themselves:
//!
//! ```sh
//! cargo run -p nullsweep-ipc-types --example ctypes > examples/python/nullsweep_types.py
//! ```
//!
//! The test `tests/python.rs` fails while that file is not what this prints.

use std::fmt::Write as _;

use nullsweep_ipc_types as wire;
use wire::service;

fn main() {
    print!("{}", module());
}

/// The sources that hold the payloads, as rustfmt lays them out.
const SOURCES: [&str; 7] = [
    include_str!("../src/plan.rs"),
    include_str!("../src/setpoint.rs"),
    include_str!("../src/state.rs"),
    include_str!("../src/telemetry.rs"),
    include_str!("../src/event.rs"),
    include_str!("../src/command.rs"),
    include_str!("../src/base.rs"),
];

/// The payloads and their sizes as the compiler has them.
const SIZES: [(&str, usize); 12] = [
    ("PlanId", size_of::<wire::PlanId>()),
    ("Knot", size_of::<wire::Knot>()),
    ("PlanHeader", size_of::<wire::PlanHeader>()),
    ("Setpoint", size_of::<wire::Setpoint>()),
    ("JointStates", size_of::<wire::JointStates>()),
    ("Telemetry", size_of::<wire::Telemetry>()),
    ("PlanEvent", size_of::<wire::PlanEvent>()),
    ("Command", size_of::<wire::Command>()),
    ("Response", size_of::<wire::Response>()),
    ("BaseJoint", size_of::<wire::BaseJoint>()),
    ("BaseCommand", size_of::<wire::BaseCommand>()),
    ("BaseStatus", size_of::<wire::BaseStatus>()),
];

/// The Python module.
pub(crate) fn module() -> String {
    let mut out = String::from(
        "\"\"\"What crosses a process boundary in Nullsweep, as ctypes structures.\n\n\
         Generated from the Rust types, do not edit:\n\
         cargo run -p nullsweep-ipc-types --example ctypes > examples/python/nullsweep_types.py\n\
         \"\"\"\n\nimport ctypes\nimport enum\n\n",
    );
    let mut put = |text: String| out.push_str(&text);
    put(format!("MAX_JOINTS = {}\n", wire::MAX_JOINTS));
    put(format!("MAX_HELD_JOINTS = {}\n", wire::MAX_HELD_JOINTS));
    put(format!("MAX_KNOTS = {}\n", wire::MAX_KNOTS));
    put(format!("MAX_NODES = {}\n", service::MAX_NODES));
    put(format!("NO_PATCH = {}\n", wire::Knot::NO_PATCH));
    put("\n_TEXTS = {}\n".into());
    put("\n# Bits of JointStates.status.\n".into());
    for (name, value) in [
        ("CALIBRATED", wire::status::CALIBRATED),
        ("HALTED", wire::status::HALTED),
        ("SETPOINT_TIMEOUT", wire::status::SETPOINT_TIMEOUT),
        ("ERROR", wire::status::ERROR),
    ] {
        put(format!("{name} = {value}\n"));
    }
    put("\n# name: publishers, subscribers, buffer, history, borrowed, overflow.\nSERVICES = {\n"
        .into());
    for q in
        [service::PLAN, service::SETPOINT, service::STATE, service::TELEMETRY, service::PLAN_EVENT]
    {
        let overflow = if q.overflow { "True" } else { "False" };
        put(format!(
            "    \"{}\": ({}, {}, {}, {}, {}, {overflow}),\n",
            q.name, q.publishers, q.subscribers, q.buffer, q.history, q.borrowed
        ));
    }
    put("}\n".into());
    for source in SOURCES {
        out.push_str(&enums(source));
        out.push_str(&structures(source));
    }
    out
}

/// Every `wire_enum!` of a source.
fn enums(source: &str) -> String {
    let mut out = String::new();
    let mut within = false;
    for line in source.lines().map(str::trim) {
        if line == "wire_enum! {" {
            within = true;
        } else if let Some(name) = line.strip_suffix(" {").filter(|_| within) {
            let _ = write!(out, "\n\nclass {name}(enum.IntEnum):\n    @property\n");
            let _ = write!(out, "    def text(self):\n        return _TEXTS[type(self)][self]\n\n");
        } else if let Some((variant, rest)) = line.split_once(" = ").filter(|_| within)
            && let Some((value, _)) = rest.split_once(" => ")
        {
            let _ = writeln!(out, "    {} = {value}", upper(variant));
        } else if line == "}" {
            within = false;
        }
    }
    // Texts belong to the names above them.
    let mut texts = String::new();
    let mut name = "";
    within = false;
    for line in source.lines().map(str::trim) {
        if line == "wire_enum! {" {
            within = true;
        } else if let Some(found) = line.strip_suffix(" {").filter(|_| within) {
            name = found;
            let _ = writeln!(texts, "_TEXTS[{name}] = {{");
        } else if let Some((variant, rest)) = line.split_once(" = ").filter(|_| within)
            && let Some((_, text)) = rest.split_once(" => ")
        {
            let text = text.trim_end_matches(',');
            let _ = writeln!(texts, "    {name}.{}: {text},", upper(variant));
        } else if line == "}" {
            if within && !name.is_empty() {
                texts.push_str("}\n");
                name = "";
            }
            within = false;
        }
    }
    if out.is_empty() { out } else { format!("{out}\n\n{texts}") }
}

/// Every payload of a source.
fn structures(source: &str) -> String {
    let mut out = String::new();
    let mut type_name = "";
    let mut open = "";
    let mut size = 0;
    for line in source.lines().map(str::trim) {
        if let Some(name) = line.strip_prefix("#[type_name(\"") {
            type_name = name.trim_end_matches("\")]");
        } else if let Some(name) =
            line.strip_prefix("pub struct ").filter(|_| !type_name.is_empty())
        {
            open = name.trim_end_matches(" {");
            size = 0;
            let _ = write!(out, "\n\nclass {open}(ctypes.Structure):\n    _fields_ = [\n");
        } else if let Some(field) = line.strip_prefix("pub ").filter(|_| !open.is_empty()) {
            let (name, kind) = field.trim_end_matches(',').split_once(": ").expect("a field");
            let (python, bytes) = python(kind);
            size += bytes;
            let _ = writeln!(out, "        (\"{name}\", {python}),");
        } else if line == "}" && !open.is_empty() {
            let stated = SIZES.iter().find(|(name, _)| *name == open).expect("a known payload").1;
            assert_eq!(size, stated, "{open}: the fields do not add up");
            let _ = write!(
                out,
                "    ]\n\n    @staticmethod\n    def type_name():\n        return \"{type_name}\"\n\n\n\
                 assert ctypes.sizeof({open}) == {size}\n"
            );
            (open, type_name) = ("", "");
        }
    }
    out
}

/// A Rust type in Python, and its size.
fn python(kind: &str) -> (String, usize) {
    let simple = |name: &str, size| (format!("ctypes.{name}"), size);
    match kind {
        "u64" => simple("c_uint64", 8),
        "u32" => simple("c_uint32", 4),
        "f64" => simple("c_double", 8),
        "u8" => simple("c_uint8", 1),
        "PlanId" => ("PlanId".into(), 16),
        "BaseJoint" => ("BaseJoint".into(), size_of::<wire::BaseJoint>()),
        "JointArray" => ("ctypes.c_double * MAX_JOINTS".into(), 8 * wire::MAX_JOINTS),
        array => {
            let (item, count) =
                array.trim_matches(['[', ']']).split_once("; ").expect("an array of a known type");
            let count = match count {
                "MAX_HELD_JOINTS" => wire::MAX_HELD_JOINTS,
                "HISTOGRAM_BUCKETS" => wire::HISTOGRAM_BUCKETS,
                number => number.parse().expect("a length"),
            };
            let (item, size) = python(item);
            (format!("{item} * {count}"), size * count)
        }
    }
}

/// A variant's name as Python writes constants.
fn upper(variant: &str) -> String {
    let mut out = String::new();
    for c in variant.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_uppercase());
    }
    out
}
