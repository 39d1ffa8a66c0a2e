//! A simulated arm behind the setpoint and state services.

use std::process::ExitCode;

fn main() -> ExitCode {
    nullsweep_tests::mock::main(std::env::args_os())
}
