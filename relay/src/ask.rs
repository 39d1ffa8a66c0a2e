//! What became of a plan, asked of the robot's end itself.

use std::fmt::Write as _;
use std::process::ExitCode;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::{EventKind, PlanEvent, PlanId, Reason};

use crate::args::AskArgs;
use crate::keys;
use crate::net::{Manner, Net};
use crate::schema::Schema;
use crate::wire::{self, Entry, Receipt, Taken, sealed};

/// The exit code where nothing is known.
const ASK_AGAIN: u8 = 4;

/// Asks and shows the answer.
///
/// # Errors
/// The network cannot be opened.
pub fn run(args: &AskArgs) -> anyhow::Result<ExitCode> {
    let net = Net::open(&args.net, &args.robot.robot_name)?;
    let seal = Schema::own().seal();
    let began = Instant::now();
    let plan = args.plan.unwrap_or(PlanId::NONE);
    // The link may take a moment to stand, and break meanwhile.
    while let Some(left) = args.timeout.checked_sub(began.elapsed()).filter(|left| !left.is_zero())
    {
        let (sender, answers) = mpsc::channel();
        let body = sealed(seal, &[bytemuck::bytes_of(&plan)]);
        net.ask(keys::OUTCOME, body, Manner::brief(left), move |answer| drop(sender.send(answer)));
        let answer = answers.recv().ok().flatten();
        let read = |bytes: &Vec<u8>| {
            let mut body = wire::opened(seal, bytes)?;
            Some((wire::next::<Receipt>(&mut body)?, wire::all::<Entry>(body)?))
        };
        if let Some((receipt, entries)) = answer.as_ref().and_then(read) {
            print!("{}", told(plan, &receipt, &entries));
            return Ok(ExitCode::SUCCESS);
        }
        std::thread::sleep(Duration::from_millis(200));
    }
    println!("unknown: the robot's end gave no answer within {:.1} s; ask again", {
        args.timeout.as_secs_f64()
    });
    Ok(ExitCode::from(ASK_AGAIN))
}

/// The answer in words, a line an event.
fn told(plan: PlanId, receipt: &Receipt, entries: &[Entry]) -> String {
    let mut text = String::new();
    for entry in entries {
        let id = if entry.origin.is_some() { entry.origin } else { entry.event.plan };
        let _ = writeln!(text, "plan {id} {}", step(&entry.event));
    }
    if plan.is_some() && entries.is_empty() {
        let taken = Taken::from_wire(receipt.taken);
        let word = match taken {
            Some(Taken::Yes) => "is before the executor, which has told nothing of it",
            Some(Taken::Never | Taken::Unknown) => "is not known to the robot's end",
            Some(taken) => taken.text(),
            None => "got a word that is not known here",
        };
        let _ = writeln!(text, "plan {plan} {word}");
    }
    text
}

fn step(event: &PlanEvent) -> String {
    let kind = EventKind::from_wire(event.kind).map_or("unknown event", EventKind::text);
    match Reason::from_wire(event.reason).filter(|reason| *reason != Reason::None) {
        Some(reason) => format!("{kind}: {reason}"),
        None => kind.into(),
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn a_plans_life_is_told_under_the_id_that_it_was_published_with() {
        let [origin, id] = [7, 9].map(|epoch| PlanId { epoch, number: 1 });
        let event = |kind: EventKind, reason: Reason| {
            let (kind, reason) = (kind.wire(), reason.wire());
            let event = PlanEvent { plan: id, kind, reason, ..PlanEvent::zeroed() };
            Entry { index: 1, origin, event }
        };
        let yes = Receipt { taken: Taken::Yes.wire(), age_ns: 0 };
        let life =
            [event(EventKind::Accepted, Reason::None), event(EventKind::Aborted, Reason::Stopped)];
        let text = told(origin, &yes, &life);
        assert_eq!(text, "plan 7/1 accepted\nplan 7/1 aborted: stopped by command\n");
        assert!(told(origin, &yes, &[]).contains("before the executor"));
        let late = Receipt { taken: Taken::Late.wire(), age_ns: 0 };
        assert_eq!(told(origin, &late, &[]), "plan 7/1 it came too late\n");
        assert_eq!(told(PlanId::NONE, &late, &[]), "");
    }
}
