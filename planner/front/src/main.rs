//! The program `nullsweep`; everything is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    nullsweep::main(std::env::args_os())
}
