//! Stops as jobs: `planner plan --stops … --jobs`, `planner plan --job`, `planner join`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use nullsweep_planner::link::Site;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::stops::{self, Rounds, Share, State, Worked};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::bars::Bars;
use crate::exit::{MORE_JOBS, OK};
use crate::line::parse;
use crate::output::{say, writable};
use crate::plan::{Files, PlanArgs};
use crate::site::SiteArgs;
use crate::stops::{Ground, StopsArgs, finish};

/// What `planner join` goes on from.
const BOARD: &str = "board.json";
/// What a job's file ends with, and what its outcome's does.
const JOB: &str = "job.json";
const DONE: &str = "done.json";

#[derive(Debug, Args)]
pub(super) struct JoinArgs {
    /// The folder that `planner plan --stops … --jobs` made.
    folder: PathBuf,
    /// Where the program is written.
    #[arg(long, short, value_name = "FILE", default_value = "program.json")]
    out: PathBuf,
    /// Write every figure of the program as JSON to a file, or `-`.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a page that shows the stops, what is swept and what is left.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// How far the jobs are.
#[derive(Debug, Serialize, Deserialize)]
struct Board {
    /// The arguments of `planner plan` that they were made by.
    words: Vec<String>,
    state: State,
    /// The round's jobs, by their files' names.
    jobs: Vec<String>,
}

/// One plan that is to be made.
#[derive(Debug, Serialize, Deserialize)]
struct Job {
    words: Vec<String>,
    state: State,
    share: Share,
}

/// Surveys, and writes the jobs of the first round.
pub(super) fn write(
    args: &StopsArgs,
    plan: &PlanArgs,
    site: Site<'_>,
    folder: &Path,
) -> anyhow::Result<u8> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    if folder.join(BOARD).exists() {
        bail!("{} has jobs already: name another folder, or remove it", folder.display());
    }
    let words = own_words()?;
    let bars = Bars::new();
    let Ground { robot, setup, scene } = args.ground(plan, site, &bars)?;
    let mut rounds = Rounds::begin(&robot, &setup, &scene, &bars)?;
    let shares = next(&mut rounds, &bars)?;
    bars.clear();
    pin(folder, words, &rounds, &shares)?;
    Ok(OK)
}

/// Does one job.
pub(super) fn work(file: &Path) -> anyhow::Result<u8> {
    let done = done_of(file)?;
    writable(&done)?;
    let Job { words, state, share } = read(file)?;
    let (args, bars) = (again(&words)?, Bars::new());
    let Ground { robot, setup, scene } = args.stops.ground(&args.plan, args.site.site(), &bars)?;
    let rounds = Rounds::resume(&robot, &setup, &scene, state)?;
    bars.stage("plan of the stop", None);
    let worked = rounds.work(&share);
    bars.clear();
    let worked = worked?;
    worked.notes.iter().for_each(|note| bars.note(note));
    put(&done, &worked)?;
    match &worked.plan {
        Ok(plan) => say!("plan of {:.1} s: {}", plan.duration(), done.display()),
        Err(why) => say!("no plan: {why}: {}", done.display()),
    }
    Ok(OK)
}

/// Puts the program together, or writes the next round's jobs.
pub(super) fn join(args: &JoinArgs) -> anyhow::Result<u8> {
    for out in [Some(&args.out), args.json.as_ref(), args.report.as_ref()].into_iter().flatten() {
        writable(out)?;
    }
    let folder = &args.folder;
    let Board { words, state, jobs } = read(&folder.join(BOARD))?;
    let open: Vec<&str> = jobs
        .iter()
        .map(String::as_str)
        .filter(|job| done_of(&folder.join(job)).is_ok_and(|done| !done.exists()))
        .collect();
    if !open.is_empty() {
        say!("{} of {} jobs are not done yet: {}", open.len(), jobs.len(), open.join(", "));
        return Ok(MORE_JOBS);
    }
    let done = jobs.iter().map(|job| read::<Worked>(&done_of(&folder.join(job))?));
    let done = done.collect::<anyhow::Result<Vec<_>>>()?;
    let (plan, bars) = (again(&words)?, Bars::new());
    let ground = plan.stops.ground(&plan.plan, plan.site.site(), &bars)?;
    let Ground { robot, setup, scene } = &ground;
    let mut rounds = Rounds::resume(robot, setup, scene, state)?;
    rounds.add(done);
    let shares = next(&mut rounds, &bars)?;
    if !shares.is_empty() {
        bars.clear();
        pin(folder, words, &rounds, &shares)?;
        return Ok(MORE_JOBS);
    }
    let program = stops::program(&rounds, &bars);
    bars.clear();
    let [json, report] = [&args.json, &args.report].map(Option::as_deref);
    finish(&program?, Files { out: &args.out, json, report }, &ground)
}

fn next(rounds: &mut Rounds<'_>, bars: &Bars) -> anyhow::Result<Vec<Share>> {
    let stops = rounds.next(bars)?.unwrap_or_default();
    Ok(stops.into_iter().flat_map(|stop| stop.shares).collect())
}

/// Writes a round's jobs, the board last: what it names is there.
fn pin(
    folder: &Path,
    words: Vec<String>,
    rounds: &Rounds<'_>,
    shares: &[Share],
) -> anyhow::Result<()> {
    let state = rounds.state();
    let round = state.rounds;
    let name = |k: usize| format!("{round}-{:03}.{JOB}", k + 1);
    let jobs: Vec<String> = (0..shares.len()).map(name).collect();
    for (share, job) in shares.iter().zip(&jobs) {
        let (words, state, share) = (words.clone(), state.clone(), share.clone());
        put(&folder.join(job), &Job { words, state, share })?;
    }
    let count = jobs.len();
    put(&folder.join(BOARD), &Board { words, state: state.clone(), jobs })?;
    say!(
        "{count} jobs of round {round} in {}: `planner plan --job FILE` for each, then `planner join {}`",
        folder.display(),
        folder.display()
    );
    Ok(())
}

/// The arguments of this call of `planner plan`, without where the jobs go.
fn own_words() -> anyhow::Result<Vec<String>> {
    let mut words = Vec::new();
    let mut given = std::env::args_os().skip_while(|word| word != "plan").skip(1);
    while let Some(word) = given.next() {
        let word = word.into_string().ok().context("an argument is no text")?;
        if word == "--jobs" {
            given.next();
        } else if !word.starts_with("--jobs=") {
            words.push(word);
        }
    }
    Ok(words)
}

/// What those arguments say.
#[derive(Debug, Args)]
struct Again {
    #[command(flatten)]
    plan: PlanArgs,
    #[command(flatten)]
    stops: StopsArgs,
    #[command(flatten)]
    site: SiteArgs,
}

/// The arguments again.
fn again(words: &[String]) -> anyhow::Result<Again> {
    let words: Vec<OsString> = words.iter().map(OsString::from).collect();
    parse(&words)
}

/// Where a job's outcome goes.
fn done_of(job: &Path) -> anyhow::Result<PathBuf> {
    let name = job.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let stem = name.strip_suffix(JOB).with_context(|| format!("{}: no job", job.display()))?;
    Ok(job.with_file_name(format!("{stem}{DONE}")))
}

fn read<T: DeserializeOwned>(file: &Path) -> anyhow::Result<T> {
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{}: no file of such jobs", file.display()))
}

/// Written beside and moved there: whoever waits for it finds the whole.
fn put(file: &Path, value: &impl Serialize) -> anyhow::Result<()> {
    let there = || format!("cannot write {}", file.display());
    let beside = file.with_extension("new");
    std::fs::write(&beside, serde_json::to_string(value)?).with_context(there)?;
    std::fs::rename(&beside, file).with_context(there)
}
