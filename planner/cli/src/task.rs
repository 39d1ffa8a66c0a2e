//! `planner task`.

use std::path::PathBuf;

use clap::Args;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::task::{self, TaskConfig, TaskFigures};

use crate::bars::Bars;
use crate::figures::{held_against, violations};
use crate::given::GivenArgs;

#[derive(Debug, Args)]
pub(super) struct TaskArgs {
    /// Poses of the tool: a table, time,x,y,z,qx,qy,qz,qw a line, apart by commas or blanks, time
    /// optional, names in the first line deciding which column is which; or YAML, JSON or G-code, as
    /// `follow` reads them.
    poses: PathBuf,
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
    let bars = Bars::new();
    let given = &args.given;
    let setting = given.setting(&args.poses, &bars)?;
    let config = TaskConfig {
        arm: given.robot.spec(),
        tool: setting.tool.clone(),
        tolerance: given.tolerance,
        start: setting.start,
        stance: setting.stance.clone(),
        speed: setting.speed,
        collision: given.robot.collision(),
        rounds: args.rounds.max(1),
        trials: args.trials.max(1),
        seed: given.seed,
    };
    let poses = setting.segments.concat();
    let outcome = task::run(&setting.robot, &poses, &setting.scene, &config, &bars);
    bars.clear();
    let outcome = outcome?;
    for note in &outcome.figures.notes {
        bars.note(note);
    }
    let rows = rows(&outcome.figures);
    given.finish(&setting, (&outcome.plan, &outcome.verification), &outcome.figures, rows)
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
