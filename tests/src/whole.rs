//! A simulated robot as one process: a base that drives and the arms on it, each behind the services of an
//! executor of its own, and what all of them together have swept of a program's surface.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, bail};
use comfy_table::{Table, presets};
use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{BaseServer, Ipc, Receiver, Sender, now_ns};
use nullsweep_ipc_types::{JointStates, PlanId, Setpoint, service};
use nullsweep_planner::link::Post;
use nullsweep_planner::plan::{Plan, Program};
use nullsweep_planner::sweep::coverage;
use nullsweep_robot::{Arm, ArmSpec, HeldJoint, JointVector, Robot};
use nullsweep_surface::Scan;
use serde::{Deserialize, Serialize};

use crate::base::Base;
use crate::clock::Grid;
use crate::endpoint::{Behaviour, Counters, Endpoint};
use crate::judge::Verdict;

const PERIOD_NS: u64 = 1_000_000;
/// Points that are less apart are the same. \[m\]
const SAME: f64 = 1e-4;

/// The robot, and where its services are.
#[derive(Clone, Debug)]
pub struct Config {
    /// The program that it is to be taken through.
    pub program: PathBuf,
    /// What it is.
    pub robot: Robot,
    /// The robot's name: that of the base's service.
    pub robot_name: String,
    /// Root path of iceoryx2.
    pub ipc_root: Option<PathBuf>,
    /// Under which name each arm is driven; with one arm the robot's where nothing is said.
    pub posts: Vec<Post>,
    /// Where the base stands at first: x, y \[m\], yaw \[rad\].
    pub base: [f64; 3],
    /// How far off its goal it ends each drive.
    pub off: [f64; 3],
    /// Of each arm.
    pub behaviour: Behaviour,
    /// Time between two postures that are kept. \[ns\]
    pub every_ns: u64,
    /// `SCHED_FIFO` priority, where permitted.
    pub priority: u8,
}

/// What came of it.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// \[s\]
    pub seconds: f64,
    /// Violations of all arms.
    pub violations: u64,
    /// Each arm.
    pub arms: Vec<ArmOutcome>,
    /// How often the base was sent somewhere.
    pub drives: u64,
    /// What the measured postures have swept.
    pub swept: SweptOf,
}

/// What came of an arm.
#[derive(Clone, Debug, Serialize)]
pub struct ArmOutcome {
    /// The robot's name of its services.
    pub robot: String,
    /// The judge's findings.
    pub verdict: Verdict,
    /// What the endpoint itself did.
    pub endpoint: Counters,
}

/// Points of a program's surface that were swept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweptOf {
    /// Points that any plan of the program knows.
    pub points: usize,
    /// Those that the pads were led over.
    pub swept: usize,
}

/// Joints by name, and where they are. \[rad\] or \[m\]
type Joints = Vec<(String, f64)>;

/// An arm and its services.
struct Limb {
    post: Post,
    arm: Arm,
    endpoint: Endpoint,
    setpoints: Receiver<Setpoint>,
    states: Sender<JointStates>,
    /// Where each of its held joints is taken from.
    held: Vec<Source>,
    pass: Vec<Setpoint>,
    newest: Option<Setpoint>,
    /// With the number of the drive after which each was measured.
    postures: Vec<(u64, JointVector)>,
}

/// Where a joint outside an arm is.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// It is a joint of this limb.
    Limb(usize, usize),
    /// The base sets it.
    Base(usize),
    /// Nothing moves it.
    Fixed(f64),
}

/// Runs until `stop`.
///
/// # Errors
/// A program or ports that cannot be used.
pub fn run(config: &Config, stop: &Arc<AtomicBool>) -> anyhow::Result<Outcome> {
    let program = Program::read(&config.program)
        .context("--program")?
        .with_context(|| format!("{} is no program", config.program.display()))?;
    let robot = &config.robot;
    if program.robot != robot.name() {
        bail!("the program was made for {}, the mock is a {}", program.robot, robot.name());
    }
    let ipc = Ipc::open(&config.robot_name, config.ipc_root.as_deref())?;
    let server = ipc.base_server()?;
    let (mut limbs, joints) = limbs(config, &program)?;
    let mut base = Base::new(config.base, joints, config.off);
    // Where it is denied the mock is only later now and then.
    let _ = become_real_time(config.priority, None);
    // Nobody need read it.
    nullsweep_executor::log::last_words(&format!(
        "mock-hardware: a {} with {} arms is ready as robot `{}`",
        robot.name(),
        limbs.len(),
        config.robot_name
    ));
    let mut stood = vec![Stood::now(&base)];
    let start_ns = now_ns();
    let (mut grid, mut keep_ns, mut now) = (Grid::new(PERIOD_NS), 0, start_ns);
    while !stop.load(Ordering::Relaxed) {
        now = grid.wait().now_ns;
        base.advance(now);
        answer(&server, &mut base, now)?;
        // What is kept of a drive is where it has come to.
        stood.truncate(base.drives() as usize);
        stood.push(Stood::now(&base));
        let keep = now >= keep_ns;
        if keep {
            keep_ns = now + config.every_ns;
        }
        for at in 0..limbs.len() {
            let held: Vec<f64> = limbs[at].held.iter().map(|h| place(*h, &limbs, &base)).collect();
            limbs[at].step(&held, now, keep.then(|| base.drives()))?;
        }
    }
    let arm = |limb: &Limb| ArmOutcome {
        robot: limb.post.robot.clone(),
        verdict: limb.endpoint.judge().verdict().clone(),
        endpoint: limb.endpoint.counters(),
    };
    Ok(Outcome {
        seconds: (now - start_ns) as f64 * 1e-9,
        violations: limbs.iter().map(|limb| limb.endpoint.judge().verdict().total()).sum(),
        arms: limbs.iter().map(arm).collect(),
        drives: base.drives(),
        swept: swept(&program, &limbs, &stood)?,
    })
}

/// What came of it, for people.
#[must_use]
pub fn table(outcome: &Outcome) -> String {
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(["mock robot", ""]);
    let mut row = |what: &str, value: String| {
        table.add_row([what.to_owned(), value]);
    };
    row("time", format!("{:.1} s", outcome.seconds));
    row("drives", outcome.drives.to_string());
    for arm in &outcome.arms {
        let (verdict, name) = (&arm.verdict, &arm.robot);
        row(&format!("{name}: setpoints"), verdict.setpoints.to_string());
        row(&format!("{name}: violations"), verdict.total().to_string());
        row(&format!("{name}: stopped by itself"), format!("{} times", arm.endpoint.timeouts));
    }
    let SweptOf { points, swept } = outcome.swept;
    row("swept points", format!("{swept} of {points}"));
    let first = outcome.arms.iter().flat_map(|arm| &arm.verdict.first);
    first.fold(table.to_string(), |text, violation| format!("{text}\n  {violation}"))
}

/// Answers what waits.
fn answer(server: &BaseServer, base: &mut Base, now: u64) -> anyhow::Result<()> {
    while let Some(request) = server.receive()? {
        let status = base.ask(&request.command(), now);
        request.answer(status)?;
    }
    Ok(())
}

/// The arms where their first plans begin, and the joints that the base sets.
fn limbs(config: &Config, program: &Program) -> anyhow::Result<(Vec<Limb>, Joints)> {
    let mut firsts: Vec<(ArmSpec, &Plan)> = Vec::new();
    for (_, work) in program.works() {
        let spec: ArmSpec = work.arm.parse().map_err(anyhow::Error::msg)?;
        if firsts.iter().all(|(known, _)| *known != spec) {
            firsts.push((spec, &work.plan));
        }
    }
    let arms: Vec<Arm> =
        firsts.iter().map(|(spec, _)| config.robot.arm(spec)).collect::<Result<_, _>>()?;
    let mut joints: Joints = Vec::new();
    for (name, _) in program.stops.iter().flat_map(|stop| &stop.held) {
        if joints.iter().all(|(known, _)| known != name) {
            let held = arms.iter().flat_map(Arm::held_joints).find(|held| held.name == *name);
            let held = held.with_context(|| format!("the robot has no joint {name} to set"))?;
            joints.push((name.clone(), held.position));
        }
    }
    let mut limbs = Vec::new();
    for (arm, (spec, first)) in arms.iter().zip(&firsts) {
        let named = config.posts.iter().find(|post| post.arm == *spec).cloned();
        let only = || Post { arm: spec.clone(), robot: config.robot_name.clone() };
        let post = named.or_else(|| (arms.len() == 1).then(only));
        let post = post.with_context(|| format!("--executor {spec}=NAME is needed"))?;
        let source = |held: &HeldJoint| {
            let of = |arm: &Arm| arm.joint_names().iter().position(|name| *name == held.name);
            let limb = arms.iter().enumerate().find_map(|(l, arm)| Some((l, of(arm)?)));
            let set = joints.iter().position(|(name, _)| *name == held.name);
            match (limb, set) {
                (Some((limb, joint)), _) => Source::Limb(limb, joint),
                (None, Some(at)) => Source::Base(at),
                (None, None) => Source::Fixed(held.position),
            }
        };
        let ipc = Ipc::open(&post.robot, config.ipc_root.as_deref())?;
        let initial = first.knots.first().context("a plan without knots")?.q;
        limbs.push(Limb {
            endpoint: Endpoint::new(arm, initial, config.behaviour.clone(), now_ns())?,
            held: arm.held_joints().iter().map(source).collect(),
            setpoints: ipc.setpoint_receiver()?,
            states: ipc.state_sender()?,
            arm: arm.clone(),
            post,
            pass: Vec::with_capacity(2 * service::SETPOINT.buffer),
            newest: None,
            postures: Vec::new(),
        });
    }
    Ok((limbs, joints))
}

fn place(source: Source, limbs: &[Limb], base: &Base) -> f64 {
    match source {
        Source::Limb(limb, joint) => limbs[limb].endpoint.positions()[joint],
        Source::Base(at) => base.joints()[at].1,
        Source::Fixed(position) => position,
    }
}

impl Limb {
    /// Follows what has come; `keep`: its posture is to be kept, with this number, if a plan runs.
    fn step(&mut self, held: &[f64], now: u64, keep: Option<u64>) -> anyhow::Result<()> {
        self.pass.clear();
        // At most one buffer and what comes meanwhile: a fast sender cannot hold the loop.
        while self.pass.len() < self.pass.capacity()
            && let Some(setpoint) = self.setpoints.receive()?
        {
            self.pass.push(setpoint);
        }
        self.endpoint.receive(&self.pass, now);
        self.newest = self.pass.last().copied().or(self.newest);
        self.endpoint.hold(held.iter().copied());
        if let Some(state) = self.endpoint.measure(now) {
            self.states.send(&state)?;
        }
        let runs = self.newest.is_some_and(|setpoint| setpoint.plan != PlanId::NONE);
        if let Some(number) = keep.filter(|_| runs) {
            self.postures.push((number, *self.endpoint.positions()));
        }
        Ok(())
    }
}

/// Where the base stood and how it had set its joints after a drive.
struct Stood {
    pose: [f64; 3],
    joints: Joints,
}

impl Stood {
    fn now(base: &Base) -> Self {
        Self { pose: base.pose(), joints: base.joints().to_vec() }
    }
}

/// Which points of the program's surface the pads were led over, the base where it really stood after each
/// drive.
fn swept(program: &Program, limbs: &[Limb], stood: &[Stood]) -> anyhow::Result<SweptOf> {
    let mut known: BTreeMap<[i64; 3], (Point3<f64>, UnitVector3<f64>)> = BTreeMap::new();
    for (_, work) in program.works() {
        let scan = work.plan.scan().transformed(&work.plan.base_pose());
        for (point, normal) in scan.points.iter().zip(&scan.normals) {
            let key = [0, 1, 2].map(|i| (point[i] / SAME).round() as i64);
            known.entry(key).or_insert((*point, *normal));
        }
    }
    let (points, normals): (Vec<_>, Vec<_>) = known.into_values().unzip();
    let scan = Scan { raw: points.clone(), points, normals, spacing: 0.0 };
    let height = program.stops.first().map_or(0.0, |stop| stop.base_height);
    let mut swept = vec![false; scan.points.len()];
    for limb in limbs {
        let tool = program.works().find_map(|(_, work)| {
            let own = work.arm.parse().is_ok_and(|arm: ArmSpec| arm == limb.post.arm);
            own.then_some(&work.plan.tool)
        });
        let Some(tool) = tool else { continue };
        for (number, Stood { pose: [x, y, yaw], joints }) in stood.iter().enumerate() {
            let pose = Isometry3::new(Vector3::new(*x, *y, height), Vector3::z() * *yaw);
            let held: Vec<_> = joints.iter().map(|(name, at)| (name.as_str(), *at)).collect();
            let arm = limb.arm.with_held(&held)?;
            let pad = tool.on(&arm);
            let here = limb.postures.iter().filter(|(at, _)| *at == number as u64);
            let contacts: Vec<_> = here.map(|(_, q)| pose * pad.pose(q)).collect();
            let hit = coverage::swept(&scan, &contacts, tool);
            swept.iter_mut().zip(hit).for_each(|(swept, hit)| *swept |= hit);
        }
    }
    Ok(SweptOf { points: swept.len(), swept: swept.iter().filter(|swept| **swept).count() })
}
