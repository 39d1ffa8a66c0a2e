//! What a recording says of an arm: what was commanded, what was measured, and how far apart they were.

use std::collections::HashMap;

use anyhow::{bail, ensure};
use nullsweep_ipc_types::PlanId;
use nullsweep_planner::plan::Plan;
use nullsweep_recording::{CycleRecord, RecordedPlan, Recording};
use nullsweep_report::{Motion, Probe, Series};
use nullsweep_robot::{Arm, JointVector, Tool};

/// Shortest time between two positions that are shown, and between two that sweep. \[s\]
const STEP: (f64, f64) = (0.02, 0.005);
/// At how many times the page's own kinematics is compared with ours.
const PROBES: usize = 60;
/// Most positions that are shown.
const MOST: f64 = 15_000.0;

/// A recorded motion; times from its first plan's start.
pub(crate) struct Flight {
    /// The setpoints.
    pub(super) commanded: Motion,
    /// What was measured.
    pub(super) measured: Motion,
    /// The first of the given plans that ran in it; 0 without any.
    pub(super) first: usize,
    /// Those of the given plans that ran in it, and when. \[s\]
    begun: Vec<(usize, f64)>,
    /// How many plans ran.
    pub(super) ran: usize,
    /// Measured positions, close enough to say what they sweep.
    pub(crate) swept: Vec<JointVector>,
    /// The largest deviation of a joint from the setpoint that it answers: which joint, by how much
    /// \[rad or m\], when \[s\]; `None` where no state named a setpoint.
    pub(super) joint: Option<(usize, f64, f64)>,
    /// The same of the pad's centre: by how much \[m\], when \[s\].
    pub(super) pad: Option<(f64, f64)>,
}

/// A state as it came first.
struct State {
    time: f64,
    q: JointVector,
    /// The setpoint that it answers.
    answers: Option<JointVector>,
}

impl Flight {
    /// Of a recording: from the first to the last setpoint of a plan, or of the plans given, each as
    /// it ran last.
    ///
    /// # Errors
    /// Where no plan ran in it, none of those given, or the recording is of an arm with another number
    /// of joints.
    pub(crate) fn of(
        recording: &Recording,
        arm: &Arm,
        tool: &Tool,
        plans: &[Plan],
    ) -> anyhow::Result<Self> {
        let span = Span::of(recording, plans)?;
        let inside: Vec<&CycleRecord> =
            recording.cycles.iter().filter(|cycle| span.holds(cycle)).collect();
        let turned = Turned { arm, plans: if plans.is_empty() { &[] } else { &recording.plans } };
        let states = states(&inside, span.from_ns, turned)?;
        let step = STEP.0.max(span.seconds() / MOST);
        let pad = tool.on(arm);
        let (mut joint, mut off) = (None::<(usize, f64, f64)>, None::<(f64, f64)>);
        for State { time, q, answers } in &states {
            let Some(commanded) = answers else { continue };
            for j in 0..arm.dof() {
                let apart = (q[j] - commanded[j]).abs();
                if joint.is_none_or(|(_, most, _)| apart > most) {
                    joint = Some((j, apart, *time));
                }
            }
            let apart = (pad.centre(q) - pad.centre(commanded)).norm();
            if off.is_none_or(|(most, _)| apart > most) {
                off = Some((apart, *time));
            }
        }
        // What is told is shown: the moments of the largest deviations are kept.
        let told = [joint.map(|(_, _, at)| at), off.map(|(_, at)| at)];
        let shown: Vec<&State> =
            thinned(&states, |s| s.time, step, |s| told.contains(&Some(s.time)));
        let deviation = Series {
            name: "deviation, pad".into(),
            unit: "mm",
            times: shown.iter().map(|s| s.time).collect(),
            values: shown
                .iter()
                .map(|s| {
                    s.answers.map_or(f64::NAN, |c| 1e3 * (pad.centre(&s.q) - pad.centre(&c)).norm())
                })
                .collect(),
            most: None,
        };
        let each = |q: &[JointVector]| -> Vec<Vec<f64>> {
            (0..arm.dof()).map(|j| q.iter().map(|q| q[j]).collect()).collect()
        };
        let measured = Motion {
            name: "measured".into(),
            times: shown.iter().map(|s| s.time).collect(),
            joints: each(&shown.iter().map(|s| s.q).collect::<Vec<_>>()),
            series: vec![deviation],
            ..Motion::default()
        };
        let targets: Vec<(f64, JointVector)> = inside
            .iter()
            .filter(|c| c.target.sequence > 0 && is_sound(&c.target.q))
            .map(|c| (seconds(c.now_ns, span.from_ns), turned.target(c)))
            .collect();
        let targets = thinned(&targets, |t| t.0, step, |_| false);
        let probe = |t: &&(f64, JointVector)| Probe { time: t.0, pad: pad.centre(&t.1) };
        let stride = targets.len().div_ceil(PROBES).max(1);
        let commanded = Motion {
            name: "commanded".into(),
            probes: targets.iter().step_by(stride).map(probe).collect(),
            times: targets.iter().map(|t| t.0).collect(),
            joints: each(&targets.iter().map(|t| t.1).collect::<Vec<_>>()),
            ..Motion::default()
        };
        ensure!(
            !measured.times.is_empty() && !commanded.times.is_empty(),
            "the recording has no state of the arm while the plan ran"
        );
        let swept = thinned(&states, |s| s.time, STEP.1, |_| false).iter().map(|s| s.q).collect();
        let Span { first, ran, begun, .. } = span;
        Ok(Self { commanded, measured, first, begun, ran, swept, joint, pad: off })
    }
}

impl Flight {
    /// When a plan's time was 0, from the start of the first plan that ran. \[s\]
    pub(super) fn began(&self, plan: usize) -> Option<(usize, f64)> {
        let found = self.begun.iter().find(|(index, _)| *index == plan)?;
        Some((self.first, found.1))
    }

    /// What was measured, on the clock of the plans' motions.
    pub(super) fn after(&self, plans: &[Motion]) -> Motion {
        let starts_at = plans.get(self.first).map_or(0.0, |plan| plan.starts_at);
        Motion { starts_at, ..self.measured.clone() }
    }
}

/// The part of a recording that is shown.
struct Span {
    from_ns: u64,
    to_ns: u64,
    first: usize,
    begun: Vec<(usize, f64)>,
    ran: usize,
}

impl Span {
    fn of(recording: &Recording, plans: &[Plan]) -> anyhow::Result<Self> {
        let mut ran: Vec<PlanId> = Vec::new();
        for cycle in recording.cycles.iter().filter(|cycle| cycle.target.plan.is_some()) {
            if ran.last() != Some(&cycle.target.plan) && !ran.contains(&cycle.target.plan) {
                ran.push(cycle.target.plan);
            }
        }
        if ran.is_empty() {
            bail!("no plan ran in the recording");
        }
        let cycles = |ids: &[PlanId]| {
            let mut times = recording
                .cycles
                .iter()
                .filter(|cycle| ids.contains(&cycle.target.plan))
                .map(|cycle| cycle.now_ns);
            let first = times.next().unwrap_or(0);
            (first, times.max().unwrap_or(first).max(first))
        };
        if plans.is_empty() {
            let (from_ns, to_ns) = cycles(&ran);
            return Ok(Self { from_ns, to_ns, first: 0, begun: Vec::new(), ran: ran.len() });
        }
        // From the last plan on backwards: each as it ran last before the one that came after it.
        let mut found: Vec<(usize, &RecordedPlan)> = Vec::new();
        let mut before_ns = u64::MAX;
        for (i, plan) in plans.iter().enumerate().rev() {
            let same = recording.plans.iter().filter(|recorded| is_of(recorded, plan));
            let runs = same.filter(|recorded| ran.contains(&recorded.id));
            let begun = runs.map(|recorded| (cycles(&[recorded.id]).0, recorded));
            let last =
                begun.filter(|(begun, _)| *begun < before_ns).max_by_key(|(begun, _)| *begun);
            if let Some((begun, recorded)) = last {
                before_ns = begun;
                found.insert(0, (i, recorded));
            }
        }
        let Some(&(first, begin)) = found.first() else {
            let others = match ran.len() {
                1 => "1 other did".into(),
                n => format!("{n} others did"),
            };
            bail!("none of the plans given ran in the recording; {others}");
        };
        let ids: Vec<PlanId> = found.iter().map(|(_, recorded)| recorded.id).collect();
        let (_, to_ns) = cycles(&ids);
        let began = |plan: &RecordedPlan| start(recording, plan).unwrap_or(cycles(&[plan.id]).0);
        let from_ns = began(begin);
        let begun = found.iter().map(|(i, plan)| (*i, seconds(began(plan), from_ns))).collect();
        Ok(Self { from_ns, to_ns, first, begun, ran: ids.len() })
    }

    fn holds(&self, cycle: &CycleRecord) -> bool {
        (self.from_ns..=self.to_ns).contains(&cycle.now_ns)
    }

    fn seconds(&self) -> f64 {
        seconds(self.to_ns, self.from_ns)
    }
}

/// Whether a recorded plan is this one.
fn is_of(recorded: &RecordedPlan, plan: &Plan) -> bool {
    recorded.knots.len() == plan.knots.len()
        && recorded
            .knots
            .iter()
            .zip(&plan.knots)
            .all(|(recorded, knot)| recorded.time == knot.time_ns as f64 && recorded.q == knot.q)
}

/// When a plan's time was 0, by when its second knot was passed: before that lies the way to its first
/// one. At full speed up to there it is right to a cycle. \[ns\]
fn start(recording: &Recording, plan: &RecordedPlan) -> Option<u64> {
    let second = plan.knots.get(1)?.time;
    let mut on = recording.cycles.iter().filter(|cycle| cycle.target.plan == plan.id);
    let passed = on.find(|cycle| cycle.target.knot > 0)?;
    Some(passed.now_ns.saturating_sub(second as u64))
}

/// How whole turns of continuous joints are shown: an executor goes through a plan by the turns that are
/// nearest to where the arm was.
#[derive(Clone, Copy)]
struct Turned<'a> {
    arm: &'a Arm,
    /// The plans by whose knots they are shown; none: as they were commanded.
    plans: &'a [RecordedPlan],
}

impl Turned<'_> {
    /// A cycle's setpoint.
    fn target(&self, cycle: &CycleRecord) -> JointVector {
        let target = &cycle.target;
        let plan = self.plans.iter().find(|plan| plan.id == target.plan);
        let knot = plan.and_then(|plan| plan.knots.get(target.knot as usize));
        knot.map_or(target.q, |knot| self.arm.continuous().nearest_turn(&target.q, &knot.q))
    }
}

/// States that came anew, in the order of their stamps, with the setpoints that they answer.
fn states(cycles: &[&CycleRecord], from_ns: u64, turned: Turned<'_>) -> anyhow::Result<Vec<State>> {
    let mut setpoints: HashMap<u64, JointVector> = HashMap::with_capacity(cycles.len());
    let (mut states, mut newest) = (Vec::<State>::new(), from_ns);
    let (continuous, dof) = (turned.arm.continuous(), turned.arm.dof());
    for cycle in cycles {
        let measured = &cycle.measured;
        let is_new = cycle.has_measured != 0 && measured.stamp_ns > newest;
        if is_new && is_sound(&measured.q) {
            let found = measured.joint_count as usize;
            ensure!(
                found == dof,
                "the recording is of an arm with {found} joints, the arm given has {dof}: say which \
                 one by --cell, or by --urdf and --arm BASE,TIP, or left"
            );
            let answers = setpoints.get(&measured.setpoint_sequence).copied();
            // An endpoint may wrap its angles. Before the first answer the setpoint is as near.
            let near = answers.unwrap_or_else(|| match states.last() {
                Some(state) => state.q,
                None if cycle.target.sequence > 0 => turned.target(cycle),
                None => measured.q,
            });
            let q = continuous.nearest_turn(&measured.q, &near);
            states.push(State { time: seconds(measured.stamp_ns, from_ns), q, answers });
            newest = measured.stamp_ns;
        }
        if cycle.target.sequence > 0 && is_sound(&cycle.target.q) {
            setpoints.insert(cycle.target.sequence, turned.target(cycle));
        }
    }
    Ok(states)
}

fn is_sound(q: &JointVector) -> bool {
    q.iter().all(|q| q.is_finite())
}

fn seconds(to_ns: u64, from_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// Those that are a step apart in time, the first and the last among them, and those that are kept.
fn thinned<T>(
    all: &[T],
    time: impl Fn(&T) -> f64,
    step: f64,
    kept: impl Fn(&T) -> bool,
) -> Vec<&T> {
    let mut last = f64::NEG_INFINITY;
    let mut some = Vec::new();
    for (i, one) in all.iter().enumerate() {
        let now = time(one);
        if now >= last + step || ((kept(one) || i + 1 == all.len()) && now > last) {
            some.push(one);
            last = now;
        }
    }
    some
}
