//! How late the executor wakes and how long its messages take.

use std::process::ExitCode;

/// This program is also an executor, whose real-time thread has a heap of its own.
#[global_allocator]
static ALLOCATOR: nullsweep_executor::PoolAllocator = nullsweep_executor::PoolAllocator::new();

fn main() -> ExitCode {
    nullsweep_tests::latency::main(std::env::args_os())
}
