//! `planner experiment`.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};
use nullsweep_experiment::{self as experiment, Object, Plan, Setting};
use nullsweep_planner::pipeline::{End, Job, StanceChoice};
use nullsweep_planner::plan::Method;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::tour::formulation::FormulationConfig;
use nullsweep_planner::tour::joint::JointConfig;
use nullsweep_planner::workcell::stance::StanceSearch;
use nullsweep_robot::{ArmSpec, Robot, Side, Tool};

use crate::bars::Bars;
use crate::bounds::{self, BoundsArgs};
use crate::exit::OK;
use crate::json::write_json;
use crate::numbers::not_negative;
use crate::output::{say_on, writable};
use crate::scene::{Demo, SceneArgs, scene};

#[derive(Debug, Args)]
pub(super) struct ExperimentArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// The paper's chair, simulated, beside its table I; with --scan that table stands beside a scan.
    Chair(Box<PaperArgs>),
    /// The paper's bobby car, simulated, beside its table II; with --scan that table stands beside a scan.
    BobbyCar(Box<PaperArgs>),
    /// How far plans are from the best ones: bounds of effort, time, pieces and coverage.
    Bounds(Box<BoundsArgs>),
}

#[derive(Debug, Args)]
struct PaperArgs {
    /// A scan instead of the simulated object, several are joined; the paper's figures do not
    /// belong to it and are left out.
    #[arg(long = "scan", value_name = "FILE")]
    scans: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Runs of each cell.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Runs of each row with tracked edges; 0: none.
    #[arg(long, default_value_t = 3)]
    tracked_repeats: u32,
    /// Samples of the inverse kinematics; without it those of the paper's table.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    ik_samples: Vec<u32>,
    /// A heading and its opposite are the same contact.
    #[arg(long)]
    symmetric: bool,
    /// Weight of turning against distance in the Curvature-GTSP (Eq. 4).
    #[arg(long, default_value_t = FormulationConfig::default().beta, value_parser = not_negative)]
    beta: f64,
    /// Seed of the first run: the object's noise and patches, too.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write tables (Markdown, CSV, JSON) and figures (SVG) into this directory.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print every figure as JSON instead of the tables.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &ExperimentArgs) -> anyhow::Result<u8> {
    match &args.what {
        What::Chair(args) => of_paper(args, Object::Chair),
        What::BobbyCar(args) => of_paper(args, Object::BobbyCar),
        What::Bounds(args) => bounds::run(args),
    }
}

/// The paper's tables.
fn of_paper(args: &PaperArgs, object: Object) -> anyhow::Result<u8> {
    if let Some(directory) = &args.out {
        std::fs::create_dir_all(directory)
            .with_context(|| format!("cannot make {}", directory.display()))?;
        let name = name(object);
        writable(&directory.join(format!("{name}.md")))?;
    }
    let bars = Bars::new();
    let robot = Robot::pr2();
    bars.stage("scan", None);
    let demo = match object {
        Object::Chair => Demo::Chair,
        Object::BobbyCar => Demo::BobbyCar,
    };
    let demo = args.scans.is_empty().then_some(demo);
    let scene = scene(&args.scene, demo, &args.scans, args.seed, &bars)?;
    let job = Job {
        tool: Tool { symmetric: args.symmetric, ..Tool::default() },
        stance: StanceChoice::Search(StanceSearch::default()),
        formulation: FormulationConfig { beta: args.beta, ..FormulationConfig::default() },
        // As in the paper, whose tables know no way back.
        end: End::Contact,
        seed: args.seed,
        ..Job::new(ArmSpec::pr2(Side::Right))
    };
    bars.stage("setting", None);
    let setting = Setting::new(&robot, &scene.surface, &job)?;
    let title = match args.scans.first().and_then(|path| path.file_stem()) {
        Some(stem) => format!("Experiment: {}", stem.to_string_lossy()),
        None => format!("Experiment: {}", name(object)),
    };
    let samples = match &args.ik_samples[..] {
        [] => experiment::samples(object).to_vec(),
        given => given.iter().map(|&n| n.max(1) as usize).collect(),
    };
    let plan = Plan {
        object: args.scans.is_empty().then_some(object),
        title,
        samples,
        repeats: args.repeats as usize,
        seed: args.seed,
        formulation: job.formulation,
        joint: JointConfig::default(),
    };
    let (mut report, shown) = experiment::run(&setting, &plan, &bars)?;
    if let Some((_, run)) = shown.iter().find(|(method, _)| *method == Method::Joint) {
        report.straight = Some(experiment::look_between(&setting, &robot, run)?);
    }
    if args.tracked_repeats > 0 {
        let repeats = args.tracked_repeats as usize;
        report.tracked = experiment::tracked(&robot, &scene, &job, repeats, &bars)?;
    }
    report.peak_memory_bytes = peak_memory();
    bars.clear();
    let tables = experiment::markdown(&report);
    if let Some(directory) = &args.out {
        let write = |file: &str, text: &str| {
            let path = directory.join(file);
            std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
        };
        let name = name(object);
        write(&format!("{name}.md"), &tables)?;
        write(&format!("{name}.csv"), &experiment::csv(&report))?;
        write_json(&report, &directory.join(format!("{name}.json")))?;
        for path in experiment::draw(directory, name, &setting, &shown)? {
            eprintln!("figure: {}", path.display());
        }
    }
    if args.json {
        write_json(&report, std::path::Path::new("-"))?;
    } else {
        say_on!("{tables}");
    }
    Ok(OK)
}

fn name(object: Object) -> &'static str {
    match object {
        Object::Chair => "chair",
        Object::BobbyCar => "bobby-car",
    }
}

/// The most memory that this process has held, where the system says. \[bytes\]
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}
