//! `planner follow`.

use std::path::PathBuf;

use clap::Args;
use nullsweep_planner::follow::{self, FollowConfig, FollowFigures, FollowOutcome};
use nullsweep_planner::link::Site;
use nullsweep_planner::poses::Poses;
use nullsweep_planner::progress::Progress;

use crate::bars::Bars;
use crate::figures::{held_against, violations};
use crate::given::{Drawn, GivenArgs, OutArgs, ReadArgs, Setting};
use crate::numbers::Numbers;
use crate::site::SiteArgs;

#[derive(Debug, Args)]
pub(super) struct FollowArgs {
    /// The tool path: a table of poses (x,y,z,qx,qy,qz,qw a line, a time before it, a column `segment`),
    /// YAML or JSON (a PoseArray, noether's tool paths), or G-code (straight cuts, G0 and G1).
    path: PathBuf,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    follow: PathArgs,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    site: SiteArgs,
}

/// How a path is followed.
#[derive(Debug, Args)]
pub(super) struct PathArgs {
    #[command(flatten)]
    given: GivenArgs,
    /// The most that a turning joint, and a sliding one, may move while the tool goes 1 cm or turns 3°:
    /// what moves more has changed its posture. [rad], [m]
    #[arg(long, value_name = "RAD,M", default_value = "0.12,0.02")]
    step: Numbers<2>,
}

pub(super) fn run(args: &FollowArgs) -> anyhow::Result<u8> {
    args.out.writable()?;
    let bars = Bars::new();
    let made = args.follow.work(args.read.read(&args.path)?, args.site.site(), &bars)?;
    args.out.finish(&made.drawn(), &made.outcome.figures)
}

/// What was made, and of what.
pub(super) struct Made {
    setting: Setting,
    pub(super) outcome: FollowOutcome,
}

impl Made {
    pub(super) fn drawn(&self) -> Drawn<'_> {
        let FollowOutcome { plan, verification, figures, .. } = &self.outcome;
        Drawn { setting: &self.setting, plan, verification, rows: rows(figures) }
    }
}

impl PathArgs {
    /// Makes the plan along some path.
    pub(super) fn work(&self, poses: Poses, site: Site<'_>, bars: &Bars) -> anyhow::Result<Made> {
        let setting = self.given.setting(poses, site, bars)?;
        let config = FollowConfig { setup: setting.setup.clone(), step: self.step.0 };
        let outcome = follow::run(&setting.robot, &setting.segments, &setting.scene, &config, bars);
        bars.clear();
        let outcome = outcome?;
        for note in &outcome.figures.notes {
            bars.note(note);
        }
        Ok(Made { setting, outcome })
    }
}

/// The figures as name and value, for people.
fn rows(f: &FollowFigures) -> Vec<[String; 2]> {
    let mm = |metres: f64| format!("{:.3}", metres * 1e3);
    let deviation = format!("{}, {} mm", mm(f.edge_deviation_p90_m), mm(f.edge_deviation_max_m));
    let error =
        format!("{} mm, {:.3}°", mm(f.position_error_max_m), f.angle_error_max_rad.to_degrees());
    let step = format!("{:.2}°, {} mm", f.step_max_rad.to_degrees(), mm(f.step_max_m));
    let sampled = format!(
        "{:.2} rad, over {} joint vectors at {} places",
        f.sampled_rad, f.samples, f.layers
    );
    vec![
        ["segments".to_owned(), f.segments.to_string()],
        ["poses, met".to_owned(), format!("{}, {}", f.poses, f.met)],
        ["reconfigurations".to_owned(), f.reconfigurations.to_string()],
        ["ways through free space".to_owned(), f.transfers.to_string()],
        ["joint movement (L2)".to_owned(), format!("{:.2} rad", f.movement_rad)],
        ["  samples' least, before smoothing".to_owned(), sampled],
        ["effort, transfers included".to_owned(), format!("{:.2} rad", f.effort_rad)],
        ["task time".to_owned(), format!("{:.2} s", f.task_time_s)],
        ["beyond the tolerance, max".to_owned(), error],
        ["edge deviation, p90, max".to_owned(), deviation],
        ["joint step, turning, sliding".to_owned(), step],
        ["violations".to_owned(), violations(f.violations, &f.against.guessed_links)],
        ["  against".to_owned(), held_against(&f.against)],
        ["calculation".to_owned(), format!("{:.2} s", f.calc_time_s)],
        ["verification".to_owned(), format!("{:.2} s", f.verify_time_s)],
    ]
}
