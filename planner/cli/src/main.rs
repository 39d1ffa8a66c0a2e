//! The `planner` binary: one call into the library.

fn main() -> std::process::ExitCode {
    nullsweep_cli::main(std::env::args_os())
}
