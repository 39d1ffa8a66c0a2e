//! The program `executor`; everything is in the library.

use std::process::ExitCode;

/// The real-time thread's own heap, the system's for the others.
#[global_allocator]
static ALLOCATOR: nullsweep_executor::PoolAllocator = nullsweep_executor::PoolAllocator::new();

fn main() -> ExitCode {
    nullsweep_executor::main_with(std::env::args_os())
}
