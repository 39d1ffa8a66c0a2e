//! `planner publish PROGRAM`: what will happen is told and asked for, then stop after stop is worked through.

use std::path::{Path, PathBuf};

use nullsweep_planner::link::journal::{Journal, Progress};
use nullsweep_planner::plan::Program;
use nullsweep_robot::{ArmSpec, Robot};

use crate::bars::Bars;
use crate::exit::{OK, Usage};
use crate::json::write_json;
use crate::numbers::percent;
use crate::output::{complain, say, writable};
use crate::program::{place, takes, tip};
use crate::program_args::{Asked, Limb, arm_of};
use crate::program_report::Report;
use crate::robot::differs;
use crate::sheet::sheet;
use crate::stop_run::Run;

/// Works through a program.
pub(super) fn run(asked: Asked<'_>, program: &Program) -> anyhow::Result<u8> {
    let own = asked.program;
    if let Some(json) = &own.json {
        if json == Path::new("-") {
            let why = "--json FILE: standard output tells what happens while it happens";
            return Err(Usage(why.into()).into());
        }
        writable(json)?;
    }
    match program.check_seal() {
        Err(error) if asked.unverified => complain!("planner: warning: {error}; it is sent anyway"),
        checked => checked?,
    }
    let robot = asked.robot.robot()?;
    let limbs = limbs(asked, program, &robot)?;
    let plans = program.works().count();
    let path = own.journal.clone().unwrap_or_else(|| beside(asked.file));
    let journal = Journal::open(&path, program.digest(), plans, own.resume)?;
    let report = Report {
        program: format!("{:016x}", program.digest()),
        journal: path,
        plans,
        ..Report::default()
    };
    if journal.done() == plans {
        say!("all {plans} plans of the program are done, says {}", journal.path().display());
        return Ok(OK);
    }
    tell_first(program, &limbs, &journal)?;
    asked.send.confirm()?;
    let seed = program.works().map(|(_, work)| work.plan.seed).next().unwrap_or(1);
    let scene = asked.way.around(asked.scans, seed, &Bars::new())?;
    let mut run = Run { asked, program, robot, limbs, scene, journal, mover: None, report };
    let went = run.all();
    run.report.done = run.journal.done();
    if let Some(json) = &own.json {
        write_json(&run.report, json)?;
    }
    went?;
    say!("the program is done: {plans} plans at {} stops", program.stops.len());
    Ok(OK)
}

/// Where a program's journal is where nobody says it.
fn beside(program: &Path) -> PathBuf {
    let mut name = program.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

/// The arms of the program, each with its executor.
fn limbs(asked: Asked<'_>, program: &Program, robot: &Robot) -> anyhow::Result<Vec<Limb>> {
    let mut limbs: Vec<Limb> = Vec::new();
    let mut known: Vec<ArmSpec> = Vec::new();
    for (s, work) in program.works() {
        let spec: ArmSpec = work.arm.parse().map_err(Usage)?;
        let arm = arm_of(robot, &spec, &work.plan)?;
        if arm.fingerprint() != work.plan.fingerprint {
            let why = differs(&work.plan, &arm);
            return Err(anyhow::anyhow!(why).context(format!("stop {}", s + 1)));
        }
        if !known.contains(&spec) {
            known.push(spec);
        }
    }
    let posts = &asked.program.executor;
    if let Some(stray) = posts.iter().find(|post| !known.contains(&post.arm)) {
        return Err(Usage(format!("--executor {}: the program has no such arm", stray.arm)).into());
    }
    for spec in &known {
        let named = posts.iter().find(|post| post.arm == *spec).map(|post| post.robot.clone());
        let only = || (known.len() == 1).then(|| asked.site.site().robot.to_owned());
        let Some(name) = named.or_else(only) else {
            let all: Vec<String> =
                known.iter().map(|arm| format!("--executor {arm}=NAME")).collect();
            return Err(Usage(format!(
                "the program has several arms, and each has an executor of its own, of another \
                 --robot-name: {}",
                all.join(" ")
            ))
            .into());
        };
        if limbs.iter().any(|limb| limb.name == name) {
            return Err(Usage(format!("two arms are to have the one executor {name}")).into());
        }
        limbs.push(Limb { spec: spec.clone(), name });
    }
    Ok(limbs)
}

/// Says what will happen.
fn tell_first(program: &Program, limbs: &[Limb], journal: &Journal) -> anyhow::Result<()> {
    let mut rows = sheet(["stop", "base", "arm", "executor", "takes", "adds", ""]);
    for (s, stop) in program.stops.iter().enumerate() {
        for (w, work) in stop.works.iter().enumerate() {
            let once = |text: String| if w == 0 { text } else { String::new() };
            let limb = limbs.iter().find(|limb| limb.spec.to_string() == work.arm);
            let state = match journal.progress((s, w)) {
                Progress::Open => "",
                Progress::Begun(_) => "was begun",
                Progress::Finished => "done",
            };
            rows.add_row([
                once((s + 1).to_string()),
                once(place(stop)),
                tip(work).to_owned(),
                limb.map_or(String::new(), |limb| limb.name.clone()),
                takes(stop, w),
                percent(work.adds),
                state.to_owned(),
            ]);
        }
    }
    say!("{rows}");
    say!(
        "the base drives from stop to stop, with all arms tucked; plans of a stop run one after the other"
    );
    if program.stops.iter().any(|stop| !stop.together.is_empty()) {
        say!(
            "those that could run at once do not: each arm has an executor of its own, and one \
             that stops stops no other"
        );
    }
    Ok(())
}
