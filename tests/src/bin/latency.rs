//! How late the executor wakes and how long its messages take.

use std::process::ExitCode;

fn main() -> ExitCode {
    nullsweep_tests::latency::main(std::env::args_os())
}
