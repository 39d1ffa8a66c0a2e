//! Solves a GTSPLIB file; prints the value and the seconds.
//!
//!     gtsplib FILE SECONDS SEED THREADS [BEST]
//!
//! It ends early at the best known value.

use std::time::Duration;

use nullsweep_gtsp::tsplib::read_gtsp;
use nullsweep_gtsp::{Budget, solve};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, seconds, seed, threads, best @ ..] = &arguments[..] else {
        return Err("usage: gtsplib FILE SECONDS SEED THREADS [BEST]".into());
    };
    let budget = Budget {
        trials: None,
        time: Some(Duration::try_from_secs_f64(seconds.parse()?)?),
        threads: threads.parse()?,
        target: best.first().map(|best| best.parse()).transpose()?,
    };
    let solution = solve(&read_gtsp(file)?.instance, &budget, seed.parse()?)?;
    println!("{} {:.3}", solution.cost.total(), solution.elapsed.as_secs_f64());
    Ok(())
}
