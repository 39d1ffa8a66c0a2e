//! `planner task`.

use std::path::PathBuf;

use clap::Args;
use nullsweep_planner::link::Site;
use nullsweep_planner::poses::Poses;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::task::{self, TaskConfig, TaskFigures, TaskOutcome};

use crate::bars::Bars;
use crate::figures::{held_against, violations};
use crate::given::{Drawn, GivenArgs, OutArgs, ReadArgs, Setting};
use crate::site::SiteArgs;

#[derive(Debug, Args)]
pub(super) struct TaskArgs {
    /// Poses of the tool: a table, time,x,y,z,qx,qy,qz,qw a line, apart by commas or blanks, time
    /// optional, names in the first line deciding which column is which; or YAML, JSON or G-code, as
    /// `follow` reads them.
    poses: PathBuf,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    task: PoseArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    site: SiteArgs,
}

/// How poses are brought into an order.
#[derive(Debug, Args)]
pub(super) struct PoseArgs {
    #[command(flatten)]
    given: GivenArgs,
    /// Rounds of order and relaxation.
    #[arg(long, default_value_t = 4)]
    rounds: usize,
    /// Trials of the order's search for each pose in each round.
    #[arg(long, default_value_t = 20)]
    trials: u64,
}

pub(super) fn run(args: &TaskArgs) -> anyhow::Result<u8> {
    args.out.writable()?;
    let bars = Bars::new();
    let made = args.task.work(args.read.read(&args.poses)?, args.site.site(), &bars)?;
    args.out.finish(&made.drawn(), &made.outcome.figures)
}

/// What was made, and of what.
pub(super) struct Made {
    setting: Setting,
    pub(super) outcome: TaskOutcome,
}

impl Made {
    pub(super) fn drawn(&self) -> Drawn<'_> {
        let TaskOutcome { plan, verification, figures, .. } = &self.outcome;
        Drawn { setting: &self.setting, plan, verification, rows: rows(figures) }
    }
}

impl PoseArgs {
    /// Makes the plan through some poses.
    pub(super) fn work(&self, poses: Poses, site: Site<'_>, bars: &Bars) -> anyhow::Result<Made> {
        let setting = self.given.setting(poses, site, bars)?;
        let config = TaskConfig {
            setup: setting.setup.clone(),
            rounds: self.rounds.max(1),
            trials: self.trials.max(1),
        };
        let poses = setting.segments.concat();
        let outcome = task::run(&setting.robot, &poses, &setting.scene, &config, bars);
        bars.clear();
        let outcome = outcome?;
        for note in &outcome.figures.notes {
            bars.note(note);
        }
        Ok(Made { setting, outcome })
    }
}

/// The figures as name and value, for people.
fn rows(f: &TaskFigures) -> Vec<[String; 2]> {
    let mm = |metres: f64| format!("{:.2}", metres * 1e3);
    let deviation = format!("{}, {} mm", mm(f.edge_deviation_p90_m), mm(f.edge_deviation_max_m));
    vec![
        ["poses, met".to_owned(), format!("{}, {}", f.poses, f.met)],
        ["joint movement (L2)".to_owned(), format!("{:.2} rad", f.movement_rad)],
        ["reconfigurations".to_owned(), f.reconfigurations.to_string()],
        ["effort, transfers included".to_owned(), format!("{:.2} rad", f.effort_rad)],
        ["task time".to_owned(), format!("{:.2} s", f.task_time_s)],
        ["beyond the tolerance, max".to_owned(), format!("{:.1e}", f.excess_max)],
        ["edge deviation, p90, max".to_owned(), deviation],
        ["violations".to_owned(), violations(f.violations, &f.against.guessed_links)],
        ["  against".to_owned(), held_against(&f.against)],
        ["calculation".to_owned(), format!("{:.2} s", f.calc_time_s)],
        ["verification".to_owned(), format!("{:.2} s", f.verify_time_s)],
    ]
}
