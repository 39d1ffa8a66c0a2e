//! Sending a plan to the executor: what will happen is told and asked for, then what happens is shown.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use nullsweep_collision::Margins;
use nullsweep_ipc_types::{Mode, PlanEvent, PlanId, Reason, Telemetry};
use nullsweep_planner::link::Site;
use nullsweep_planner::link::posture::{Posture, PostureError, posture, unit, unit_of_held};
use nullsweep_planner::link::publish::{
    Join, Patience, PublishError, Watcher, describe_for, fate, publish,
};
use nullsweep_planner::plan::{Held, Plan, Stretch};
use nullsweep_planner::sweep::coverage;
use nullsweep_robot::{Arm, wrap};

use crate::figures::OWN_SURFACE;
use crate::numbers::seconds;
use crate::output::tell;

#[derive(Debug, Args)]
pub(super) struct SendArgs {
    /// Do not ask before the arm moves. Nothing is asked either where standard input is no terminal.
    #[arg(long, short)]
    yes: bool,
    /// Seconds to wait for the executor's admission.
    #[arg(long, value_name = "S", default_value = "5", value_parser = seconds)]
    timeout: Duration,
}

/// How long the executor is listened to for where the arm is, where that must be known, and where it is
/// only told.
pub(super) const LISTEN: Duration = Duration::from_secs(5);
const LOOK: Duration = Duration::from_secs(1);
/// What an executor bridges by itself unless it is told otherwise. \[rad\] or \[m\]
pub(super) const BRIDGED: f64 = 0.02;
/// How far a held joint may be unless an executor is told otherwise. \[rad\] or \[m\]
const HELD: f64 = 0.002;
/// A way to a plan's start that is worth a word. \[rad\] or \[m\]
const WORTH: f64 = 0.001;

/// The plan was rejected because the arm is elsewhere.
#[derive(Debug, thiserror::Error)]
#[error("rejected: the arm is not where the plan starts: {}", .joints.join(", "))]
pub(super) struct Elsewhere {
    /// Each joint that is too far away, and by how much.
    joints: Vec<String>,
    /// Whether a plan was stopped on its way there.
    pub(super) stopped: bool,
    /// The plan's file, if it has one.
    pub(super) plan: Option<PathBuf>,
}

/// The plan was rejected because joints that it takes as fixed stand elsewhere.
#[derive(Debug, thiserror::Error)]
#[error("rejected: held joints are not where the plan has them: {}", .joints.iter().map(|j| j.told.as_str()).collect::<Vec<_>>().join(", "))]
pub(super) struct HeldElsewhere {
    pub(super) joints: Vec<HeldOff>,
    pub(super) plan: Option<PathBuf>,
}

/// A held joint that stands elsewhere than a plan has it.
#[derive(Debug)]
pub(super) struct HeldOff {
    pub(super) name: String,
    /// Where it stands. \[rad\] or \[m\]
    pub(super) stands: f64,
    told: String,
}

/// The held joints that are farther from where a plan has them than an executor allows unless it is told
/// otherwise.
pub(super) fn held_apart(plan: &Plan, arm: &Arm, now: &Posture) -> Vec<HeldOff> {
    let both = plan.held.iter().zip(&now.held);
    let off = both.filter_map(|(Held { name, position: planned }, &stands)| {
        let unit = unit_of_held(arm, name);
        let apart = if unit == "rad" { wrap(planned - stands) } else { planned - stands };
        let told = format!(
            "{name} by {apart:.3} {unit} (measured at {stands:.3}, planned for {planned:.3})"
        );
        (apart.abs() > HELD).then(|| HeldOff { name: name.clone(), stands, told })
    });
    off.collect()
}

/// An operator has stopped the plan on its way.
#[derive(Debug, thiserror::Error)]
#[error("ended early: {}", describe_for(.event, &[], &[]))]
pub(super) struct Stopped {
    pub(super) event: Box<PlanEvent>,
    /// The plan's file; none of a way to a posture.
    pub(super) plan: Option<PathBuf>,
}

/// The user said no.
#[derive(Debug, thiserror::Error)]
#[error("nothing was sent")]
pub(super) struct NotSent;

/// Where the arm is, if it rests.
pub(super) fn resting(site: Site<'_>, arm: &Arm) -> Option<Posture> {
    posture(site, arm, LOOK).ok()
}

/// What becomes of a plan that runs when another one is to begin at rest, as a line of an outlook; empty
/// where none runs.
pub(super) fn interruption(site: Site<'_>, arm: &Arm) -> &'static str {
    match posture(site, arm, LOOK) {
        Err(PostureError::NotHeld(Mode::Executing | Mode::Paused | Mode::Stopping)) => {
            "  joins     after a stop of the plan that runs, and only if that stop ends where this one \
             starts;\n            plans of replan, or of plan --continue PLAN@K, take over in motion\n"
        }
        _ => "",
    }
}

/// How far each joint is from a plan's start, by name, where it is by more than `bound`.
pub(super) fn apart(plan: &Plan, arm: &Arm, now: &Posture, bound: f64) -> Vec<String> {
    let Some(first) = plan.knots.first() else { return Vec::new() };
    let apart = arm.continuous().displacement(&now.q, &first.q);
    let joints = arm.joint_names().iter().enumerate().zip(&apart);
    let far = joints.filter(|(_, apart)| apart.abs() > bound);
    far.map(|((j, name), apart)| format!("{name} by {apart:.3} {}", unit(arm, j))).collect()
}

/// Joints without end that stand whole turns from 0, and what to do.
fn wound(arm: &Arm, now: &Posture) -> Vec<String> {
    let joints = arm.joint_names().iter().enumerate();
    let turning = joints.filter(|(j, _)| arm.continuous().is(*j));
    let wound = turning.filter_map(|(j, name)| {
        let turns = (now.q[j] / std::f64::consts::TAU).trunc();
        let s = if turns.abs() == 1.0 { "" } else { "s" };
        (turns != 0.0).then(|| {
            format!("{name} by {turns:+.0} turn{s}: `planner goto home --unwind` turns it back")
        })
    });
    wound.collect()
}

/// What a plan will do, a line each.
pub(super) fn outlook(plan: &Plan, arm: Option<&Arm>, now: Option<&Posture>) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: &str| {
        let _ = writeln!(text, "  {name:<9} {value}");
    };
    let joints = (plan.joints.first(), plan.joints.last());
    if let (Some(first), Some(last)) = joints {
        line("robot", &format!("{}, {first} … {last}", plan.robot));
    }
    if let (Some(arm), Some(now)) = (arm, now) {
        let far = apart(plan, arm, now, WORTH);
        match &far[..] {
            [] => line("starts", "where the arm is"),
            far => far.iter().enumerate().for_each(|(i, far)| {
                line(if i == 0 { "starts" } else { "" }, &format!("away: {far}"));
            }),
        }
        for wound in wound(arm, now) {
            line("wound up", &wound);
        }
        if !apart(plan, arm, now, BRIDGED).is_empty() {
            line("", "farther than an executor goes by itself: --goto brings it there");
            if let Some(knot) = now.stopped {
                line(
                    "",
                    &format!("the last plan was stopped in knot {knot}: to go on with what it has"),
                );
                line("", "left, `planner replan --running PLAN SCAN…`");
            }
        }
    }
    if let (Some(arm), Some(now)) = (arm, now) {
        for (i, off) in held_apart(plan, arm, now).iter().enumerate() {
            line(if i == 0 { "held" } else { "" }, &format!("away: {}", off.told));
        }
    }
    // The margins are no choice of the command line.
    let kept = 1e3 * Margins::default().environment;
    match plan.check_seal() {
        Ok(()) => {
            line("verified", &format!("{kept:.0} mm kept clear, but for the tool on the surface"))
        }
        Err(why) => line("warning", &why.to_string()),
    }
    line("takes", &format!("{:.1} s at full speed", plan.duration()));
    if plan.is_of_poses() {
        let mut met: Vec<u32> = plan.knots.iter().filter_map(|knot| knot.patch).collect();
        met.sort_unstable();
        met.dedup();
        line("meets", &format!("{} of {} poses", met.len(), plan.patches.len()));
    } else if let Some([reachable, all]) = arm.and_then(|arm| swept(plan, arm)) {
        let share = |share: f64| format!("{:.1} %", 100.0 * share);
        let (reachable, all) = (share(reachable), share(all));
        let by = if plan.tool.touches() { String::new() } else { format!(", {OWN_SURFACE}") };
        line("sweeps", &format!("{reachable} of what is reachable, {all} of all points{by}"));
    }
    let on_surface = plan.knots.last().is_some_and(|knot| knot.line.is_some());
    line("ends", if on_surface { "on the surface" } else { "off the surface" });
    text
}

/// Shares of the plan's reachable points, and of all, that are swept by its end; none of a plan that is
/// to sweep nothing.
fn swept(plan: &Plan, arm: &Arm) -> Option<[f64; 2]> {
    let reachable = plan.surface.iter().filter(|s| s.reachable).count();
    if reachable == 0 || plan.check_bounds().is_err() {
        return None;
    }
    let followed = plan.followed(plan.knots.len());
    let swept = coverage::swept_by(&plan.scan(), followed.iter().map(Stretch::trajectory), arm);
    let hit = swept.iter().zip(&plan.surface).filter(|(swept, s)| **swept && s.reachable).count();
    Some([hit as f64 / reachable as f64, coverage::share(&swept)])
}

impl SendArgs {
    /// How long a plan is waited for: its end comes after the plans before it and may be slowed down, so
    /// generously.
    fn patience(&self, plan: &Plan) -> Patience {
        let end = Some(Duration::from_secs_f64(10.0 * plan.duration() + 600.0));
        Patience { admission: self.timeout, end }
    }

    /// What became of a plan that was sent before, see [`fate`]; how far it is is shown while it runs.
    pub(super) fn fate(
        &self,
        id: PlanId,
        plan: &Plan,
        site: Site<'_>,
    ) -> Result<Option<PlanEvent>, PublishError> {
        let mut told = |_: &PlanEvent| ();
        let mut show = Show::new(plan, &mut told);
        let fate = fate(id, site, self.patience(plan), &mut show);
        show.bar.finish_and_clear();
        fate
    }

    /// Asks whether to go on, where there is somebody to ask.
    pub(super) fn confirm(&self) -> Result<(), NotSent> {
        if self.yes || !std::io::stdin().is_terminal() {
            return Ok(());
        }
        eprint!("move the arm? [y/N] ");
        let _ = std::io::stderr().flush();
        let mut answer = String::new();
        let read = std::io::stdin().read_line(&mut answer);
        let yes = matches!(answer.trim().to_lowercase().as_str(), "y" | "yes");
        if read.is_ok() && yes { Ok(()) } else { Err(NotSent) }
    }

    /// Sends a plan, shows how far it is while its end is waited for, and tells what became of it.
    ///
    /// # Errors
    /// As [`publish`]; [`Elsewhere`] where the arm is not where the plan starts, [`HeldElsewhere`] where
    /// other joints are not, [`Stopped`] where an operator has stopped it.
    pub(super) fn send(
        &self,
        (plan, file): (&Plan, Option<&Path>),
        arm: Option<&Arm>,
        site: Site<'_>,
        join: Join,
        wait: bool,
    ) -> anyhow::Result<()> {
        self.send_told((plan, file), (arm, site), join, wait, &mut |_| ())
    }

    /// The same, and `told` is told every event of the plan.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub(super) fn send_told(
        &self,
        (plan, file): (&Plan, Option<&Path>),
        (arm, site): (Option<&Arm>, Site<'_>),
        join: Join,
        wait: bool,
        told: &mut dyn FnMut(&PlanEvent),
    ) -> anyhow::Result<()> {
        let patience = Patience { end: None, ..self.patience(plan) };
        let patience = if wait { self.patience(plan) } else { patience };
        let mut show = Show::new(plan, told);
        let sent = publish(plan, site.robot, site.root, join, patience, &mut show);
        show.bar.finish_and_clear();
        let Err(error) = sent else { return Ok(()) };
        if let (PublishError::Rejected(why), Some(arm)) = (&error, arm)
            && Reason::from_wire(why.reason) == Some(Reason::Start)
            && let Some(now) = resting(site, arm)
        {
            let joints = apart(plan, arm, &now, why.bound);
            if !joints.is_empty() {
                let (stopped, plan) = (now.stopped.is_some(), file.map(Path::to_path_buf));
                return Err(Elsewhere { joints, stopped, plan }.into());
            }
        }
        if let (PublishError::Rejected(why), Some(arm)) = (&error, arm)
            && Reason::from_wire(why.reason) == Some(Reason::HeldJoint)
            && let Some(now) = resting(site, arm)
        {
            let joints = held_apart(plan, arm, &now);
            if !joints.is_empty() {
                return Err(HeldElsewhere { joints, plan: file.map(Path::to_path_buf) }.into());
            }
        }
        match error {
            PublishError::EndedEarly(event) if event.reason == Reason::Stopped.wire() => {
                Err(Stopped { event, plan: file.map(Path::to_path_buf) }.into())
            }
            error => Err(error.into()),
        }
    }
}

/// Steps of the bar: thousandths.
const STEPS: u64 = 1000;

/// Events as lines, and a bar with the time that is left.
struct Show<'a> {
    told: &'a mut dyn FnMut(&PlanEvent),
    bar: ProgressBar,
    duration: f64,
    joints: Vec<String>,
    held: Vec<Held>,
}

impl<'a> Show<'a> {
    fn new(plan: &Plan, told: &'a mut dyn FnMut(&PlanEvent)) -> Self {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3} % {msg}") {
            bar.set_style(style);
        }
        let (joints, held) = (plan.joints.clone(), plan.held.clone());
        Self { told, bar, duration: plan.duration(), joints, held }
    }
}

impl Watcher for Show<'_> {
    fn event(&mut self, event: &PlanEvent) {
        (self.told)(event);
        self.bar.suspend(|| tell!("{}", describe_for(event, &self.joints, &self.held)));
    }

    fn progress(&mut self, telemetry: &Telemetry) {
        if !telemetry.plan.is_some() || self.duration <= 0.0 {
            return;
        }
        let time = telemetry.plan_time_ns as f64 * 1e-9;
        let left = (self.duration - time).max(0.0);
        let mode = Mode::from_wire(telemetry.mode).map_or("", Mode::text);
        let scale = telemetry.speed_scale;
        self.bar.set_position(((time / self.duration).min(1.0) * STEPS as f64) as u64);
        self.bar.set_message(match mode {
            "executing" if scale > 0.01 => format!("{:.0} s left", left / scale),
            mode => format!("{mode}, {left:.0} s at full speed left"),
        });
    }
}
