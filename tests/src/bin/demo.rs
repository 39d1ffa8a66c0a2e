//! The whole job on one stage: plan a chair's seat, start mock and executor, sweep it, and swap in
//! a second plan mid-motion.

use std::process::ExitCode;

/// This program is also an executor, whose real-time thread has a heap of its own.
#[global_allocator]
static ALLOCATOR: nullsweep_executor::PoolAllocator = nullsweep_executor::PoolAllocator::new();

fn main() -> ExitCode {
    nullsweep_tests::demo::main(std::env::args_os())
}
