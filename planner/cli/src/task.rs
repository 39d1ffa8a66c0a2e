//! `planner task`.

use std::path::PathBuf;

use clap::Args;
use comfy_table::Table;
use nalgebra::Isometry3;
use nullsweep_collision::Obstacle;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::task::{self, TaskConfig, TaskFigures, Tolerance};

use crate::bars::Bars;
use crate::exit::OK;
use crate::json::write_json;
use crate::numbers::{finite, velocity};
use crate::output::{say, writable};
use crate::plan::violations;
use crate::refusal::write_unless_broken;
use crate::robot::{RobotArgs, tool_file};
use crate::sheet::sheet;

#[derive(Debug, Args)]
pub(super) struct TaskArgs {
    /// Poses of the tool in the robot's root frame: time,x,y,z,qx,qy,qz,qw a line, apart by commas or
    /// blanks, time optional; names in the first line decide which column is which.
    poses: PathBuf,
    #[command(flatten)]
    robot: RobotArgs,
    /// The tool, a TOML file, whose contact frame meets the poses; without it the tip frame itself.
    #[arg(long, value_name = "FILE")]
    tool: Option<PathBuf>,
    /// How far the tool may be from a pose, along and about its axes: X,Y,Z,RX,RY,RZ, in metres
    /// and radians or `free`.
    #[arg(long, value_name = "TOLERANCE", default_value = "0,0,0,0,0,free")]
    tolerance: Tolerance,
    /// Height of the floor in the robot's root frame; without it 0, or just under the lowest pose
    /// where that is lower. [m]
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = finite)]
    floor: Option<f64>,
    /// One velocity for all joints, where the robot's own limits are higher. [rad/s]
    #[arg(long, value_parser = velocity)]
    v_max: Option<f64>,
    /// Rounds of order and relaxation.
    #[arg(long, default_value_t = 4)]
    rounds: usize,
    /// Trials of the order's search for each pose in each round.
    #[arg(long, default_value_t = 20)]
    trials: u64,
    /// Seed of every random choice: the same seed gives the same plan.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where the plan is written.
    #[arg(long, short, value_name = "FILE", default_value = "plan.json")]
    out: PathBuf,
    /// Write every figure of the run as JSON to a file, or `-`.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &TaskArgs) -> anyhow::Result<u8> {
    for out in [&args.out].into_iter().chain(&args.json) {
        writable(out)?;
    }
    let bars = Bars::new();
    let robot = args.robot.robot()?;
    args.robot.tell(&robot, &bars)?;
    let task::Poses { poses, notes } = task::read(&args.poses)?;
    for note in &notes {
        bars.note(note);
    }
    let tool = args.tool.as_deref().map_or(Ok(task::tip_tool()), tool_file)?;
    let collision = args.robot.collision();
    let floor = args.floor.unwrap_or_else(|| {
        let floor = task::floor_under(&poses, &tool, collision.margins.environment);
        bars.note(&format!(
            "the floor is taken to be at z = {floor:.3} m: --floor says where it is"
        ));
        floor
    });
    let config = TaskConfig {
        arm: args.robot.spec(),
        tool,
        tolerance: args.tolerance,
        held: Vec::new(),
        obstacles: vec![Obstacle::floor(Isometry3::translation(0.0, 0.0, floor))],
        collision,
        v_max: args.v_max,
        rounds: args.rounds.max(1),
        trials: args.trials.max(1),
        seed: args.seed,
    };
    let outcome = task::run(&robot, &poses, &config, &bars);
    bars.clear();
    let outcome = outcome?;
    let figures = &outcome.figures;
    for note in &figures.notes {
        bars.note(note);
    }
    let to_stdout = args.json.as_deref() == Some(std::path::Path::new("-"));
    if let Some(path) = &args.json {
        write_json(figures, path)?;
    }
    if !to_stdout {
        say!("{}", table(figures));
    }
    let code = write_unless_broken(&outcome.plan, &outcome.verification.violations, &args.out)?;
    if code == OK && !to_stdout {
        say!("plan: {}", args.out.display());
    }
    Ok(code)
}

fn table(f: &TaskFigures) -> Table {
    let mut table = sheet(["figure", "value"]);
    let mm = |metres: f64| format!("{:.2}", metres * 1e3);
    let deviation = format!("{}, {} mm", mm(f.edge_deviation_p90_m), mm(f.edge_deviation_max_m));
    table.add_rows([
        ["poses, met".to_owned(), format!("{}, {}", f.poses, f.met)],
        ["joint movement (L2)".to_owned(), format!("{:.2} rad", f.movement_rad)],
        ["reconfigurations".to_owned(), f.reconfigurations.to_string()],
        ["effort, transfers included".to_owned(), format!("{:.2} rad", f.effort_rad)],
        ["task time".to_owned(), format!("{:.2} s", f.task_time_s)],
        ["beyond the tolerance, max".to_owned(), format!("{:.1e}", f.excess_max)],
        ["edge deviation, p90, max".to_owned(), deviation],
        [
            "violations, against itself and the floor".to_owned(),
            violations(f.violations, &f.guessed_links),
        ],
        ["calculation".to_owned(), format!("{:.2} s", f.calc_time_s)],
        ["verification".to_owned(), format!("{:.2} s", f.verify_time_s)],
    ]);
    table
}
