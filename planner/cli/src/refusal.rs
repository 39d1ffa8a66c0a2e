//! A plan that breaks a rule is told and not written.

use std::path::Path;

use nullsweep_planner::plan::Plan;
use nullsweep_planner::verify::Violation;

use crate::exit::{OK, VIOLATIONS};
use crate::output::complain;

/// Most violations that are told one by one.
const TOLD: usize = 10;

/// Writes the plan, sealed as verified, or tells what it breaks; the exit code.
pub(super) fn write_unless_broken(
    plan: &Plan,
    violations: &[Violation],
    out: &Path,
) -> anyhow::Result<u8> {
    if violations.is_empty() {
        plan.clone().sealed().write(out)?;
        return Ok(OK);
    }
    tell(violations);
    complain!("planner: the plan breaks {} rules and was not written", violations.len());
    Ok(VIOLATIONS)
}

/// Says what a plan breaks, one by one.
pub(super) fn tell(violations: &[Violation]) {
    for v in violations.iter().take(TOLD) {
        eprintln!("violation at knot {}: {:?}: {}", v.knot, v.kind, v.detail);
    }
}
