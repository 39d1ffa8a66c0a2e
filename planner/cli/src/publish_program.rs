//! `planner publish PROGRAM`: what will happen is told and asked for, then stop after stop is worked through.

use std::path::{Path, PathBuf};

use clap::Args;
use nullsweep_planner::link::base::displacement;
use nullsweep_planner::link::journal::Journal;
use nullsweep_planner::link::{Post, Site};
use nullsweep_planner::plan::{Plan, PlanError, Program, ProgramStop, Work};
use nullsweep_planner::workcell::stance::told;
use nullsweep_robot::{Arm, ArmSpec, Robot};
use serde::Serialize;

use crate::bars::Bars;
use crate::exit::{OK, Usage};
use crate::json::write_json;
use crate::numbers::not_negative;
use crate::output::{complain, say, writable};
use crate::publish::PublishArgs;
use crate::robot::differs;
use crate::sheet::sheet;
use crate::stop_run::Run;

#[derive(Debug, Args)]
pub(super) struct ProgramArgs {
    /// Of a program: go on where its journal says that it was left. With the scans, given as they were to
    /// `plan`, a plan that was left on its way is planned anew for what it has left.
    #[arg(long, group = "seen")]
    pub(super) resume: bool,
    /// Of a program: the robot's name in the service names of an arm's executor, ARM as in --arms; may be
    /// repeated. Without it that of --robot-name, which is also the base's, where the program has one arm.
    #[arg(long, value_name = "ARM=NAME")]
    pub(super) executor: Vec<Post>,
    /// Of a program: where it is kept what is done; without it PROGRAM.journal.
    #[arg(long, value_name = "FILE")]
    pub(super) journal: Option<PathBuf>,
    /// Of a program: how far what is to be swept may lie from where a plan has it, because the base stands
    /// off its place: plans keep 5 mm clear. [m]
    #[arg(long, value_name = "M", default_value_t = 0.005, value_parser = not_negative)]
    pub(super) base_off: f64,
    /// Of a program: write what was done as JSON to a file, or `-`.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

impl ProgramArgs {
    /// Refuses what says something of programs alone, of a plan.
    pub(super) fn of_a_plan(&self) -> Result<(), Usage> {
        let is_said = self.resume
            || !self.executor.is_empty()
            || self.journal.is_some()
            || self.json.is_some();
        if is_said {
            return Err(Usage(
                "--resume, --executor, --journal and --json are for programs, of `planner plan --stops`: \
                 `planner replan` goes on with a plan"
                    .into(),
            ));
        }
        Ok(())
    }
}

/// An arm of the program, and where its executor is.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    pub(super) spec: ArmSpec,
    /// The robot's name in its executor's service names.
    pub(super) name: String,
}

/// What was done, for machines.
#[derive(Debug, Default, Serialize)]
pub(super) struct Report {
    pub(super) program: String,
    pub(super) journal: PathBuf,
    /// Plans of the program, and those that are done.
    pub(super) plans: usize,
    pub(super) done: usize,
    pub(super) stops: Vec<Stood>,
    pub(super) steps: Vec<Step>,
}

/// Where the base stood at a stop.
#[derive(Debug, Serialize)]
pub(super) struct Stood {
    /// From 1.
    pub(super) stop: usize,
    pub(super) base: [f64; 3],
    pub(super) measured: bool,
    pub(super) drove: bool,
    /// How far what is to be swept lay from where the plans have it. \[m\]
    pub(super) off_m: f64,
}

/// A plan that this run had to do with.
#[derive(Debug, Serialize)]
pub(super) struct Step {
    /// From 1.
    pub(super) stop: usize,
    pub(super) plan: usize,
    pub(super) arm: String,
    pub(super) outcome: Outcome,
}

/// What became of it.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Outcome {
    /// From its start to its end.
    Finished,
    /// It had come to its end by itself, nobody waiting for it.
    FoundFinished,
    /// What was left of it was planned anew and swept.
    RestFinished,
    /// It was left where nothing was left to sweep, and the arm brought to where it ends.
    NothingLeft,
    /// From its start once more.
    BegunAgain,
}

pub(super) fn run(args: &PublishArgs, program: &Program) -> anyhow::Result<u8> {
    let own = &args.program;
    if args.join.is_some() {
        return Err(Usage("--join is for plans: those of a program begin at rest".into()).into());
    }
    if let Some(json) = &own.json {
        writable(json)?;
    }
    match program.check_seal() {
        Err(error) if args.unverified => complain!("planner: warning: {error}; it is sent anyway"),
        checked => checked?,
    }
    let robot = args.robot.robot()?;
    let limbs = limbs(args, program, &robot)?;
    let plans = program.works().count();
    let path = own.journal.clone().unwrap_or_else(|| beside(&args.plan));
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
    args.send.confirm()?;
    let seed = program.works().map(|(_, work)| work.plan.seed).next().unwrap_or(1);
    let scene = args.way.around(&args.scans, seed, &Bars::new())?;
    let mut run = Run { args, program, robot, limbs, scene, journal, mover: None, report };
    let went = run.all();
    run.report.done = run.journal.done();
    if let Some(json) = &own.json {
        write_json(&run.report, json)?;
    }
    went?;
    if own.json.as_deref() != Some(Path::new("-")) {
        say!("the program is done: {plans} plans at {} stops", program.stops.len());
    }
    Ok(OK)
}

/// Where a program's journal is where nobody says it.
fn beside(program: &Path) -> PathBuf {
    let mut name = program.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

/// The arms of the program, each with its executor.
fn limbs(args: &PublishArgs, program: &Program, robot: &Robot) -> anyhow::Result<Vec<Limb>> {
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
    let posts = &args.program.executor;
    if let Some(stray) = posts.iter().find(|post| !known.contains(&post.arm)) {
        return Err(Usage(format!("--executor {}: the program has no such arm", stray.arm)).into());
    }
    for spec in &known {
        let named = posts.iter().find(|post| post.arm == *spec).map(|post| post.robot.clone());
        let only = || (known.len() == 1).then(|| args.site.site().robot.to_owned());
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

/// An arm, its held joints where a plan has them.
pub(super) fn arm_of(robot: &Robot, spec: &ArmSpec, plan: &Plan) -> anyhow::Result<Arm> {
    let held: Vec<_> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    Ok(robot.arm(spec)?.with_held(&held)?)
}

/// The arm's last link, by which people know it.
pub(super) fn tip(work: &Work) -> &str {
    work.arm.rsplit(',').next().unwrap_or(&work.arm)
}

/// A stop as people are told where it is.
pub(super) fn place(stop: &ProgramStop) -> String {
    let held = stop.held.iter().map(|(name, at)| format!(", {name} at {at}"));
    format!("{}{}", told(&stop.base), held.collect::<String>())
}

/// Says what will happen.
fn tell_first(program: &Program, limbs: &[Limb], journal: &Journal) -> anyhow::Result<()> {
    use nullsweep_planner::link::journal::Progress;
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
                format!("{:.1} s", work.plan.duration()),
                crate::numbers::percent(work.adds),
                state.to_owned(),
            ]);
        }
    }
    say!("{rows}");
    say!(
        "the base drives from stop to stop, with all arms tucked; plans of a stop run one after the other"
    );
    Ok(())
}

/// How far what the plans of a stop are to sweep lies from where they have it, the most of all. \[m\]
pub(super) fn off_place(stop: &ProgramStop, stands: [f64; 3]) -> f64 {
    stop.works.iter().map(|work| displacement(&work.plan, stands)).fold(0.0, f64::max)
}

/// A plan that was written beside the journal, if it is as it was verified.
pub(super) fn rest_file(file: &Path) -> Result<Plan, PlanError> {
    let plan = Plan::read(file)?;
    plan.check_seal()?;
    Ok(plan)
}

/// The site of an arm's executor.
pub(super) fn site<'a>(args: &'a PublishArgs, limb: &'a Limb) -> Site<'a> {
    Site { robot: &limb.name, root: args.site.site().root }
}
