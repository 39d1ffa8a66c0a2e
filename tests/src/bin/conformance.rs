//! Does a hardware endpoint keep what the executor relies on?

use std::process::ExitCode;

fn main() -> ExitCode {
    nullsweep_tests::conformance::main(std::env::args_os())
}
