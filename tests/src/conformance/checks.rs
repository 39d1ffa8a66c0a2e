//! What the executor relies on in an endpoint, rule by rule.

use core::f64::consts::TAU;

use nullsweep_executor::Hardware;
use nullsweep_ipc_types::ports::PortError;
use nullsweep_ipc_types::{JointStates, status};
use nullsweep_robot::{Continuous, JointVector};

use super::rig::{Clock, Command, PERIOD_NS, Rig};

/// How an endpoint is tried.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// How far each joint is moved. \[rad\] or \[m\]
    pub angle: f64,
    /// How fast, as a share of its velocity limit.
    pub speed: f64,
    /// How soon after the last setpoint's deadline the endpoint must have stopped and said so.
    /// \[ms\]
    pub grace_ms: u64,
    /// How soon the motors must be on again once a disable is taken back. \[ms\]
    pub power_ms: u64,
    /// How old a state may be when it is read. \[ms\]
    pub stale_ms: u64,
    /// How far the arm may be from its setpoint at rest. \[rad\] or \[m\]
    pub tolerance: f64,
    /// How far it may be behind for each unit of speed. \[s\]
    pub lag: f64,
}

impl Default for Terms {
    /// The executor's own bounds.
    fn default() -> Self {
        Self {
            angle: 0.08,
            speed: 0.1,
            grace_ms: 100,
            power_ms: 300,
            stale_ms: 20,
            tolerance: 0.02,
            lag: 0.15,
        }
    }
}

/// Why a rule is broken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Broken {
    /// What was found instead.
    #[error("{0}")]
    Rule(String),
    /// The port failed.
    #[error("the port failed: {0}")]
    Port(#[from] PortError),
}

/// A rule that an endpoint must keep.
pub struct Check<H, C> {
    /// Its name.
    pub name: &'static str,
    /// What is asked.
    pub asks: &'static str,
    /// Whether the arm moves when the rule is tried.
    pub moves: bool,
    /// Whether setpoints are sent that must not be followed.
    pub dares: bool,
    pub(super) run: fn(&mut Rig<H, C>, &Terms) -> Result<(), Broken>,
}

/// Every rule, in the order in which they are tried.
#[must_use]
pub fn checks<H: Hardware, C: Clock>() -> Vec<Check<H, C>> {
    let check = |name, asks, run| Check { name, asks, moves: false, dares: false, run };
    vec![
        check("shape", "states have the arm's joints, all finite, calibrated, not halted", shape),
        check("stream", "states come in time: numbers and stamps rise, none is stale", stream),
        check("answer", "states tell the newest setpoint that was had", answer),
        check("hold", "the arm stays where it is commanded to stay", hold),
        Check { moves: true, ..check("follow", "each joint follows, and no other moves", follow) },
        check("watchdog", "when setpoints cease it stops by itself, and says so", watchdog),
        check("again", "after a stop it follows setpoints that begin where it is", again),
        check("late", "it begins also with an executor that has counted for long", late),
        Check {
            dares: true,
            ..check("turns", "whole turns of a continuous joint are no way to go", turns)
        },
        Check {
            dares: true,
            ..check("refuse", "after a stop it follows none from afar, and says so", refuse)
        },
        Check { dares: true, ..check("nonsense", "NaN and a wrong count move nothing", nonsense) },
        check("disable", "asked to, it turns the motors off, and on again", disable),
    ]
}

fn broken<T>(what: String) -> Result<T, Broken> {
    Err(Broken::Rule(what))
}

const fn ms(ms: u64) -> u64 {
    ms * 1_000_000 / PERIOD_NS
}

impl<H: Hardware, C: Clock> Rig<H, C> {
    fn state(&mut self) -> Result<JointStates, Broken> {
        for _ in 0..ms(2000) {
            if let Some(state) = self.cycle(None)? {
                return Ok(state);
            }
        }
        broken("no state came within 2 s".into())
    }

    /// Holds with a command for so many cycles.
    fn keep(&mut self, command: &Command, cycles: u64) -> Result<(), PortError> {
        for _ in 0..cycles {
            self.cycle(Some(command))?;
        }
        Ok(())
    }

    fn has(&self, bit: u32) -> bool {
        self.newest.is_some_and(|s| s.status & bit != 0)
    }

    /// The joint that is farthest from `q`, and how far.
    fn farthest(&self, q: &JointVector) -> (usize, f64) {
        let off = Continuous::of(self.arm.limits()).displacement(&self.measured(), q);
        (0..self.arm.dof())
            .map(|j| (j, off[j]))
            .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a })
    }

    fn near(&self, q: &JointVector, within: f64, when: &str) -> Result<(), Broken> {
        let (j, off) = self.farthest(q);
        if off <= within {
            return Ok(());
        }
        broken(format!(
            "{} is {off:.4} off {when}, {within} are allowed",
            self.arm.joint_names()[j]
        ))
    }

    /// Lets setpoints cease until the endpoint says that it stopped by itself.
    fn cease(&mut self, terms: &Terms) -> Result<(), Broken> {
        // One period until the last setpoint's deadline, and two in transit.
        for _ in 0..ms(terms.grace_ms) + 3 {
            self.cycle(None)?;
            if self.has(status::SETPOINT_TIMEOUT) {
                return Ok(());
            }
        }
        broken(format!("{} ms after the last setpoint it does not say so", terms.grace_ms))
    }
}

fn shape<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, _: &Terms) -> Result<(), Broken> {
    let state = rig.state()?;
    let (dof, held) = (rig.arm.dof(), rig.arm.held_joints().len());
    if state.joint_count as usize != dof {
        return broken(format!("{} joints, the arm has {dof}", state.joint_count));
    }
    if state.held_count as usize != held {
        return broken(format!("{} held joints, the robot has {held}", state.held_count));
    }
    let used = [&state.positions, &state.velocities].into_iter().flat_map(|v| &v[..dof]);
    if !used.chain(&state.held_positions[..held]).all(|v| v.is_finite()) {
        return broken("a position or velocity is not finite".into());
    }
    let unused = [&state.positions, &state.velocities].into_iter().flat_map(|v| &v[dof..]);
    if !unused.copied().all(|v| v == 0.0) {
        return broken("an entry past the joint count is not 0".into());
    }
    if state.status & status::CALIBRATED == 0 {
        return broken("it is not calibrated".into());
    }
    if state.status & (status::HALTED | status::ERROR) != 0 {
        return broken("it is halted or reports an error".into());
    }
    Ok(())
}

fn stream<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    let mut last = rig.state()?;
    let mut stale = 0;
    for _ in 0..ms(1000) {
        if let Some(state) = rig.cycle(None)? {
            if state.sequence <= last.sequence {
                return broken(format!("number {} after {}", state.sequence, last.sequence));
            }
            if state.stamp_ns <= last.stamp_ns {
                return broken("a stamp does not rise".into());
            }
            if state.stamp_ns > rig.now_ns + PERIOD_NS {
                return broken("a stamp lies in the future: is it CLOCK_MONOTONIC?".into());
            }
            last = state;
        }
        stale += u64::from(rig.now_ns.saturating_sub(last.stamp_ns) > terms.stale_ms * 1_000_000);
    }
    // The reader itself may be stalled now and then.
    if stale > ms(1000) / 20 {
        return broken(format!(
            "states older than {} ms in {stale} of 1000 cycles",
            terms.stale_ms
        ));
    }
    Ok(())
}

fn answer<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, _: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let command = rig.at(rig.measured());
    rig.keep(&command, ms(200))?;
    let mut told = 0;
    for _ in 0..ms(100) {
        rig.cycle(Some(&command))?;
        let next = rig.newest.map_or(0, |s| s.setpoint_sequence);
        if next < told {
            return broken(format!("after setpoint {told} it tells number {next}"));
        }
        told = next;
    }
    let sent = rig.sequence;
    if told > sent {
        return broken(format!("it tells setpoint {told}, {sent} were sent"));
    }
    // As much as the executor's own bound on stale states.
    if sent - told > ms(100) {
        return broken(format!("after {sent} setpoints it tells number {told}"));
    }
    let received = rig.newest.map_or(0, |s| s.setpoint_received_ns);
    if received == 0 || received > rig.now_ns + PERIOD_NS {
        return broken("when the setpoint came is not on CLOCK_MONOTONIC".into());
    }
    Ok(())
}

fn hold<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let q = rig.measured();
    let command = rig.at(q);
    for _ in 0..10 {
        rig.keep(&command, ms(100))?;
        rig.near(&q, terms.tolerance, "while it holds")?;
    }
    Ok(())
}

fn follow<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let home = rig.measured();
    let settle = rig.at(home);
    rig.keep(&settle, ms(100))?;
    for j in 0..rig.arm.dof() {
        let limits = rig.arm.limits()[j];
        let speed = terms.speed * limits.velocity;
        let (lower, upper) = rig.arm.braking_limits(j, speed);
        // Towards where there is more room.
        let up = !lower.is_finite() || upper - home[j] >= home[j] - lower;
        let angle = if up { terms.angle } else { -terms.angle };
        if !(lower..=upper).contains(&(home[j] + angle)) {
            return broken(format!("{} has no room for {angle}", rig.arm.joint_names()[j]));
        }
        for (from, to) in [(0.0, angle), (angle, 0.0)] {
            let cycles = (terms.angle / speed * 1e9 / PERIOD_NS as f64).ceil();
            for k in 1..=cycles as u64 {
                let mut command = rig.at(home);
                command.q[j] += from + (to - from) * k as f64 / cycles;
                command.v[j] = speed * (to - from).signum();
                rig.cycle(Some(&command))?;
                let behind = terms.tolerance + terms.lag * speed;
                rig.near(&command.q, behind, &format!("while joint {j} moves"))?;
            }
            let mut there = rig.at(home);
            there.q[j] += to;
            rig.keep(&there, ms(300))?;
            rig.near(&there.q, terms.tolerance, &format!("after joint {j} moved by {angle:.3}"))?;
            let missing =
                Continuous::of(rig.arm.limits()).displacement(&rig.measured(), &there.q)[j];
            if missing > 0.5 * terms.angle {
                return broken(format!("{} does not move", rig.arm.joint_names()[j]));
            }
        }
    }
    Ok(())
}

fn watchdog<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let q = rig.measured();
    let command = rig.at(q);
    rig.keep(&command, ms(200))?;
    if rig.has(status::SETPOINT_TIMEOUT) {
        return broken("it says that setpoints ceased while they flow".into());
    }
    rig.cease(terms)?;
    for _ in 0..ms(500) {
        rig.cycle(None)?;
    }
    rig.near(&q, terms.tolerance, "after it stopped by itself")
}

fn again<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let command = rig.at(rig.measured());
    rig.keep(&command, ms(100))?;
    rig.cease(terms)?;
    // Another executor counts from 1 again, after a silence.
    for _ in 0..ms(300) {
        rig.cycle(None)?;
    }
    rig.sequence = 0;
    let q = rig.measured();
    let command = rig.at(q);
    rig.keep(&command, ms(200))?;
    if rig.has(status::SETPOINT_TIMEOUT) {
        return broken("it still says that setpoints ceased".into());
    }
    rig.near(&q, terms.tolerance, "after it was taken over")
}

fn late<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let command = rig.at(rig.measured());
    rig.keep(&command, ms(100))?;
    rig.cease(terms)?;
    rig.sequence += 10_000_000;
    let (before, q) = (rig.sequence, rig.measured());
    let command = rig.at(q);
    rig.keep(&command, ms(300))?;
    let told = rig.newest.map_or(0, |s| s.setpoint_sequence);
    let follows = !rig.has(status::SETPOINT_TIMEOUT) && told > before;
    let stays = rig.near(&q, terms.tolerance, "after it was taken over");
    // The rules that come next count anew, whatever was found.
    for _ in 0..ms(300) {
        rig.cycle(None)?;
    }
    rig.sequence = 0;
    if follows {
        stays
    } else {
        broken(format!("from setpoint {before} on it tells number {told}"))
    }
}

fn turns<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    let arm = rig.arm.clone();
    for j in (0..arm.dof()).filter(|j| arm.limits()[*j].continuous) {
        let name = &arm.joint_names()[j];
        rig.state()?;
        for turns in [-1.0, 2.0] {
            let here = rig.at(rig.measured());
            rig.keep(&here, ms(100))?;
            rig.cease(terms)?;
            let begins = rig.measured();
            let mut command = rig.at(begins);
            command.q[j] += turns * TAU;
            for _ in 0..ms(300) {
                rig.cycle(Some(&command))?;
                // What begins to turn is not waited for.
                rig.near(&begins, terms.tolerance, &format!("while {name} is {turns} turns away"))?;
            }
            if rig.has(status::SETPOINT_TIMEOUT) {
                return broken(format!("it does not follow where {name} is {turns} turns away"));
            }
            // What begins next has its own turns.
            rig.cease(terms)?;
        }
    }
    Ok(())
}

fn refuse<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let q = rig.measured();
    let command = rig.at(q);
    rig.keep(&command, ms(100))?;
    rig.cease(terms)?;
    let mut away = rig.at(rig.measured());
    for j in 0..rig.arm.dof() {
        let (lower, upper) = rig.arm.braking_limits(j, 0.0);
        let up = !lower.is_finite() || upper - q[j] >= q[j] - lower;
        away.q[j] += if up { 3.0 * terms.tolerance } else { -3.0 * terms.tolerance };
    }
    rig.keep(&away, ms(300))?;
    rig.near(&q, terms.tolerance, "after setpoints from afar")?;
    if !rig.has(status::SETPOINT_TIMEOUT) {
        return broken("it does not say that it follows none of the setpoints from afar".into());
    }
    let command = rig.at(rig.measured());
    Ok(rig.keep(&command, ms(100))?)
}

fn nonsense<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let q = rig.measured();
    let sound = rig.at(q);
    rig.keep(&sound, ms(100))?;
    let mut nan = sound;
    nan.q[0] = f64::NAN;
    let mut count = sound;
    count.joint_count = rig.arm.dof() as u32 - 1;
    count.q[0] += 3.0 * terms.tolerance;
    for bad in [nan, count] {
        rig.keep(&bad, ms(10))?;
        rig.keep(&sound, ms(50))?;
        let finite = rig.measured().iter().all(|q| q.is_finite());
        if !finite {
            return broken("a measured position is not finite any more".into());
        }
        rig.near(&q, terms.tolerance, "after nonsense")?;
    }
    Ok(())
}

fn disable<H: Hardware, C: Clock>(rig: &mut Rig<H, C>, terms: &Terms) -> Result<(), Broken> {
    rig.state()?;
    let command = rig.at(rig.measured());
    rig.keep(&command, ms(100))?;
    let mut off = rig.at(rig.measured());
    off.disable = true;
    rig.keep(&off, ms(200))?;
    if !rig.has(status::HALTED) {
        return broken("200 ms after a disable it does not say that it is halted".into());
    }
    let q = rig.measured();
    let on = rig.at(q);
    rig.keep(&on, ms(terms.power_ms))?;
    if rig.has(status::HALTED) {
        return broken(format!(
            "{} ms after the disable was taken back it is still halted",
            terms.power_ms
        ));
    }
    rig.near(&q, terms.tolerance, "after the motors came on again")
}
