//! Untrusted inputs of Nullsweep as functions of bytes.
//!
//! A [`Target`] takes any bytes and gives them to the very function that would meet them: it never
//! panics, always ends, and says whether they were taken. The fuzzer runs it (`fuzz/`), and so does a
//! test on any toolchain, with each file of `corpus/` and some thousand mutants of it ([`mutant`]).

mod arm;
mod file;
mod gtsp;
mod mesh;
pub mod mutant;
mod plan;
mod poses;
mod recording;
mod regions;
mod register;
mod room;
mod scan;
mod script;
mod srdf;
mod tool;
mod urdf;
mod wire;

use std::path::PathBuf;

/// An input and the function that meets it.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// What it is called: of the fuzz target and of the folder of its corpus.
    pub name: &'static str,
    /// Takes any bytes; whether they were taken as sound. A panic is a finding.
    pub run: fn(&[u8]) -> bool,
    /// Sound inputs that are made and not kept as files.
    pub made: fn() -> Vec<Vec<u8>>,
    /// Mutants of each seed in the test, so that it takes seconds.
    pub mutants: u64,
}

/// All of them.
pub const TARGETS: &[Target] = &[
    Target { name: "plan", run: plan::run, made: plan::made, mutants: 1000 },
    Target { name: "wire", run: wire::run, made: wire::made, mutants: 2000 },
    Target { name: "urdf", run: urdf::run, made: none, mutants: 2000 },
    Target { name: "srdf", run: srdf::run, made: none, mutants: 5000 },
    Target { name: "recording", run: recording::run, made: none, mutants: 2000 },
    Target { name: "scan", run: scan::run, made: none, mutants: 2000 },
    Target { name: "poses", run: poses::run, made: none, mutants: 5000 },
    Target { name: "tool", run: tool::run, made: tool::made, mutants: 5000 },
    Target { name: "regions", run: regions::run, made: regions::made, mutants: 5000 },
    Target { name: "gtsp", run: gtsp::run, made: none, mutants: 1000 },
    Target { name: "mesh", run: mesh::run, made: none, mutants: 1000 },
    Target { name: "room", run: room::run, made: room::made, mutants: 50 },
    Target { name: "register", run: register::run, made: register::made, mutants: 10 },
];

fn none() -> Vec<Vec<u8>> {
    Vec::new()
}

impl Target {
    /// The target of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        TARGETS.iter().find(|target| target.name == name)
    }

    /// The folder of its corpus. Files whose names begin with `sound` are sound; the others once made
    /// something fail.
    #[must_use]
    pub fn corpus(&self) -> PathBuf {
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("corpus").join(self.name)
    }
}

/// Runs a target by name: what a fuzz target does.
///
/// # Panics
/// There is none of that name, or the input is a finding.
pub fn run(name: &str, bytes: &[u8]) {
    let target = Target::named(name).expect("a target's name");
    (target.run)(bytes);
}
