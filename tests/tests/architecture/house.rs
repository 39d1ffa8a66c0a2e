//! The plan of the house: every table that the rules go by. To allow something, allow it here.

/// What a crate may depend on.
pub(crate) enum May {
    /// Just these crates of ours, by folder. One that is not needed any more is to be struck.
    Import(&'static [&'static str]),
    /// All of ours.
    ImportAll,
}

/// A crate of ours: its folder, its dependencies, and those of its tests and benches besides.
pub(crate) struct Crate {
    pub(crate) dir: &'static str,
    pub(crate) may: May,
    pub(crate) dev: &'static [&'static str],
}

const fn leaf(dir: &'static str) -> Crate {
    with(dir, &[])
}

const fn with(dir: &'static str, may: &'static [&'static str]) -> Crate {
    Crate { dir, may: May::Import(may), dev: &[] }
}

/// Every crate of the repository.
pub(crate) const CRATES: &[Crate] = &[
    leaf("ipc-types"),
    leaf("robot"),
    leaf("robot/cell"),
    with("recording", &["ipc-types", "robot"]),
    leaf("planner/gtsp"),
    leaf("planner/grid"),
    with("planner/surface", &["planner/grid"]),
    with("planner/collision", &["planner/grid", "robot"]),
    with(
        "planner",
        &["ipc-types", "robot", "planner/gtsp", "planner/surface", "planner/collision"],
    ),
    leaf("planner/report"),
    with(
        "planner/experiment",
        &["planner", "planner/gtsp", "planner/surface", "planner/collision", "robot"],
    ),
    with(
        "planner/cli",
        &[
            "planner",
            "planner/gtsp",
            "planner/surface",
            "planner/collision",
            "planner/report",
            "planner/experiment",
            "robot",
            "robot/cell",
            "recording",
            "ipc-types",
        ],
    ),
    with("planner/front", &["robot/cell"]),
    with("executor", &["ipc-types", "robot", "robot/cell", "recording"]),
    with("bridge", &["ipc-types", "robot", "executor"]),
    Crate { dir: "tests", may: May::ImportAll, dev: &[] },
    with(
        "tests/inputs",
        &[
            "planner",
            "planner/gtsp",
            "planner/surface",
            "planner/collision",
            "executor",
            "recording",
            "robot",
            "ipc-types",
        ],
    ),
    with("fuzz", &["tests/inputs"]),
    with("pr2-bridge", &["ipc-types", "robot", "robot/cell", "executor", "bridge"]),
    with("ros2-bridge", &["ipc-types", "robot", "robot/cell", "executor", "bridge"]),
    // Of planner and executor it knows the wire alone; its tests start an executor.
    Crate {
        dir: "relay",
        may: May::Import(&["ipc-types", "robot/cell"]),
        dev: &["executor", "robot"],
    },
    // The planner's commands as Python's functions; of the executor it knows the wire alone.
    with(
        "python",
        &[
            "planner",
            "planner/cli",
            "planner/gtsp",
            "planner/report",
            "robot",
            "robot/cell",
            "ipc-types",
        ],
    ),
];

/// Crates that share the wire and nothing else: no way may lead from one to the other.
pub(crate) const STRANGERS: &[(&str, &str)] = &[("planner", "executor")];

/// Which of a crate's top-level modules may import which.
pub(crate) enum Storeys {
    /// Each module with all that it may import.
    Table(&'static [(&'static str, &'static [&'static str])]),
    /// From the bottom to the top: each may import all that stand before it.
    Ladder(&'static [&'static str]),
}

/// The storeys of a crate, by the folder of its sources.
pub(crate) const STOREYS: &[(&str, Storeys)] = &[
    ("planner/src", Storeys::Table(PLANNER)),
    ("planner/collision/src", Storeys::Ladder(COLLISION)),
    ("planner/surface/src", Storeys::Ladder(SURFACE)),
];

/// What storey 3 may import, and, with storey 3 itself, storey 4.
const BELOW_3: &[&str] = &["progress", "cost", "workcell", "plan", "roadmap", "sweep"];
#[rustfmt::skip]
const BELOW_4: &[&str] = &[
    "progress", "cost", "regions", "workcell", "plan", "roadmap", "sweep",
    "tour", "motion", "fairing", "timing", "verify", "link",
];

/// The same for those that go through given poses.
#[rustfmt::skip]
const WITH_POSES: &[&str] = &[
    "progress", "cost", "workcell", "plan", "roadmap", "sweep",
    "tour", "motion", "fairing", "timing", "verify", "link", "poses",
];

/// The same for those who make many plans of one scene.
#[rustfmt::skip]
const WITH_PIPELINE: &[&str] = &[
    "progress", "cost", "cover", "workcell", "plan", "roadmap", "sweep",
    "tour", "motion", "fairing", "timing", "verify", "coordinate", "link", "pipeline",
];

const PLANNER: &[(&str, &[&str])] = &[
    // 0
    ("progress", &[]),
    ("cost", &[]),
    ("band", &[]),
    ("regions", &[]),
    ("cover", &[]),
    // 1
    ("workcell", &["progress", "cost", "regions"]),
    // 2
    ("plan", &["progress", "cost", "regions", "workcell"]),
    ("roadmap", &["progress", "cost", "workcell", "plan"]),
    // 3: none imports another but sweep, and fairing timing; what the search knows is kept from verify
    ("sweep", &["progress", "cost", "workcell", "plan", "roadmap"]),
    ("tour", BELOW_3),
    ("motion", BELOW_3),
    // Ways are bent for the time that they take.
    ("fairing", &["progress", "cost", "band", "workcell", "plan", "roadmap", "sweep", "timing"]),
    ("timing", &["progress", "cost", "band", "workcell", "plan", "roadmap", "sweep"]),
    ("verify", &["progress", "cost", "regions", "workcell", "plan", "sweep"]),
    // How two plans keep clear of each other: their paths and times alone.
    ("coordinate", &["plan"]),
    ("link", BELOW_3),
    // given poses: what those who go through them share
    ("poses", BELOW_4),
    // 4: none imports another
    ("pipeline", BELOW_4),
    ("task", WITH_POSES),
    ("follow", WITH_POSES),
    ("transit", BELOW_4),
    // 5: many plans, and how far one is from the best
    ("bounds", WITH_PIPELINE),
    ("stops", WITH_PIPELINE),
];

#[rustfmt::skip]
const COLLISION: &[&str] = &[
    "frame", "rules", "points", "tree", "mesh", "srdf", "error", "options", "solid",
    "obstacle", "spheres", "sieve", "field", "bodies", "parts", "figure", "shapes", "sight", "pairs", "scene",
    "across", "exact", "exact_arms", "clearance", "fixed", "moving", "motion", "never", "world", "check", "arms",
    "proof",
];

const SURFACE: &[&str] = &[
    "grid", "thin", "fit", "scan", "simulate", "change", "room", "register", "sheet", "patches",
    "unseen",
];

/// Modules that must not name anything of others: folder of the sources, module, the others.
pub(crate) const APART: &[(&str, &str, &[&str])] = &[
    // What is wrong in the search must not be wrong in the verification too.
    (
        "planner/src",
        "verify",
        &[
            "roadmap",
            "tour",
            "motion",
            "fairing",
            "coordinate",
            "pipeline",
            "poses",
            "task",
            "follow",
            "transit",
        ],
    ),
    ("planner/src", "fairing", &["verify"]),
    ("planner/src", "roadmap", &["verify"]),
    ("planner/src", "tour", &["verify"]),
    ("planner/src", "motion", &["verify"]),
    ("planner/collision/src", "exact", &["frame", "spheres", "sieve", "field", "bodies"]),
    ("planner/collision/src", "exact_arms", &["frame", "spheres", "sieve", "field", "bodies"]),
];

/// Libraries of others, and the only folders that may name them.
pub(crate) const ROOMS: &[(&str, &[&str])] = &[
    ("parry3d-f64", &["planner/collision"]),
    (
        "clap",
        &[
            "robot/cell",
            "planner/cli",
            "planner/front",
            "executor",
            "tests",
            "pr2-bridge",
            "ros2-bridge",
            "relay",
        ],
    ),
    ("clap_complete", &["planner/front"]),
    ("clap_mangen", &["planner/front"]),
    ("ratatui", &["executor/src/top"]),
    ("indicatif", &["planner/cli"]),
    ("plotly", &["tests"]),
    ("serde-saphyr", &["planner/src/poses/read"]),
    ("gcode", &["planner/src/poses/read"]),
    ("mcap", &["planner/report", "planner/cli/tests"]),
    ("zenoh", &["relay"]),
    ("plotters", &["planner/experiment"]),
    ("earcut", &["planner/src/regions"]),
    ("comfy-table", &["planner/cli", "planner/experiment", "tests"]),
];

/// Sources whose results are in plans, and so are the same to the bit on every processor.
pub(crate) const ROUNDED: &[&str] = &[
    "robot/src",
    "planner/src",
    "planner/collision/src",
    "planner/experiment/src",
    "planner/grid/src",
    "planner/gtsp/src",
    "planner/surface/src",
];

/// Enums that tell a refusal: a test names each of their variants.
pub(crate) const REFUSALS: &[&str] = &["ViolationKind", "Reason", "Fault"];

/// Programs whose subcommands the documents may name.
pub(crate) const PROGRAMS: &[&str] =
    &["planner", "executor", "nullsweep", "pr2-bridge", "ros2-bridge", "relay"];

/// The most lines of a file.
pub(crate) const FILE_LINES: usize = 450;
/// The most lines of a function, from its signature to its last brace.
pub(crate) const FUNCTION_LINES: usize = 100;
/// The most parameters of a function beside `self`.
pub(crate) const PARAMETERS: usize = 6;
