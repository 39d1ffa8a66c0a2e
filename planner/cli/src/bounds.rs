//! `planner experiment bounds`.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, ValueEnum};
use nullsweep_experiment::{Bounded, bounded, bounds_markdown};
use nullsweep_planner::bounds::Ascent;
use nullsweep_planner::pipeline::Job;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::Scene;

use crate::bars::Bars;
use crate::choices::{CostArg, MethodArg};
use crate::exit::OK;
use crate::json::write_json;
use crate::output::{say_on, writable};
use crate::robot::{RobotArgs, tool_file};
use crate::scene::{Demo, SceneArgs, scene};

#[derive(Debug, Args)]
pub(super) struct BoundsArgs {
    /// What is planned for, each by itself: chair, chair-seat, bobby-car, car-door (simulated),
    /// or a file as `planner plan` takes it.
    #[arg(required = true, value_name = "OBJECT")]
    objects: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    robot: RobotArgs,
    /// The tool, a TOML file; without it a sponge of 0.10 × 0.07 m.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// How the order is found; several are done one after the other.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "curvature")]
    method: Vec<MethodArg>,
    /// What is minimised; several are done one after the other.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "effort")]
    cost: Vec<CostArg>,
    /// Samples of the inverse kinematics at each tool pose.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1000))]
    ik_samples: u32,
    /// Plans of each, by seeds from --seed on.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Seed of the first plan.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Groups of joint vectors that the bound of a cost tells apart: more make it higher,
    /// slower, and take memory by their square.
    #[arg(long, default_value_t = Ascent::default().groups, value_parser = groups)]
    groups: usize,
    /// Steps of that bound's ascent.
    #[arg(long, default_value_t = Ascent::default().steps)]
    steps: u64,
    /// Write the tables (Markdown) into this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write every figure as JSON to a file, or `-`, instead of the tables.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// As many as the bound can be of.
fn groups(text: &str) -> Result<usize, String> {
    let count: usize = text.parse().map_err(|e| format!("{e}"))?;
    if (1..=3998).contains(&count) { Ok(count) } else { Err("1 to 3998 are wanted".into()) }
}

impl BoundsArgs {
    /// What is there, in the floor frame, and its name.
    fn object(&self, object: &Path, seed: u64, bars: &Bars) -> anyhow::Result<(String, Scene)> {
        bars.stage("scan", None);
        let demo = object.to_str().and_then(|name| Demo::from_str(name, false).ok());
        let scans = if demo.is_some() { Vec::new() } else { vec![object.to_owned()] };
        let name = object.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok((name, scene(&self.scene, demo, &scans, seed, bars)?))
    }

    /// All plans of one scene, with their bounds.
    fn rows(&self, object: &Path, bars: &Bars, rows: &mut Vec<Bounded>) -> anyhow::Result<()> {
        let robot = self.robot.robot()?;
        self.robot.tell(&robot, bars)?;
        let tool = self.tool.as_deref().map(tool_file).transpose()?.unwrap_or_default();
        let ascent = Ascent { groups: self.groups, steps: self.steps, ..Ascent::default() };
        for seed in (0..u64::from(self.repeats)).map(|k| self.seed.saturating_add(k)) {
            let (name, scene) = self.object(object, seed, bars)?;
            for (&method, &cost) in
                self.method.iter().flat_map(|m| self.cost.iter().map(move |c| (m, c)))
            {
                let job = Job {
                    method: method.method(),
                    cost: cost.into(),
                    ik_samples: self.ik_samples as usize,
                    seed,
                    collision: self.robot.collision(),
                    ..Job::new(self.robot.spec()).with_tool(tool.clone())
                };
                rows.push(bounded(&robot, &scene, (&name, &job), &ascent, bars)?);
            }
        }
        Ok(())
    }
}

pub(super) fn run(args: &BoundsArgs) -> anyhow::Result<u8> {
    for out in [&args.out, &args.json].into_iter().flatten() {
        writable(out)?;
    }
    let bars = Bars::new();
    let mut rows = Vec::new();
    for object in &args.objects {
        args.rows(object, &bars, &mut rows)
            .with_context(|| format!("no bounds of {}", object.display()))?;
    }
    bars.clear();
    let tables = bounds_markdown(&rows);
    if let Some(path) = &args.out {
        std::fs::write(path, &tables)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    match &args.json {
        Some(path) => write_json(&rows, path)?,
        None => say_on!("{tables}"),
    }
    Ok(OK)
}
