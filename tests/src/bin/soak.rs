//! Runs the system for an hour with everything that can happen to it: a laboratory run.

use std::process::ExitCode;

/// This program is also an executor, whose real-time thread has a heap of its own.
#[global_allocator]
static ALLOCATOR: nullsweep_executor::PoolAllocator = nullsweep_executor::PoolAllocator::new();

fn main() -> ExitCode {
    nullsweep_tests::soak::main(std::env::args_os())
}
