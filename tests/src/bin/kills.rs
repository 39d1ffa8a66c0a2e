//! Kills planner, executor and mock at random moments: a laboratory run.

use std::process::ExitCode;

/// This program is also an executor, whose real-time thread has a heap of its own.
#[global_allocator]
static ALLOCATOR: nullsweep_executor::PoolAllocator = nullsweep_executor::PoolAllocator::new();

fn main() -> ExitCode {
    nullsweep_tests::kills::main(std::env::args_os())
}
