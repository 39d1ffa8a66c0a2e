//! From two postures and a scene to a verified plan.

use nullsweep_collision::{Clearance, Options, ToolContact, World};
use nullsweep_robot::{ArmSpec, JointVector, Robot, Tool};
use rayon::prelude::*;

use super::error::{Place, TransitError};
use crate::cost;
use crate::motion::jump;
use crate::plan::{Plan, PlanKnot, Profile, SurfaceSample};
use crate::progress::Progress;
use crate::timing::{self, Limits, Pace, paced};
use crate::verify::{Given, Verification, verify};
use crate::workcell::{Scene, Stance, Workcell};

/// From where to where, of which arm.
#[derive(Clone, Debug)]
pub struct Transit {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool at its tip.
    pub tool: Tool,
    /// Where the robot stands, and its held joints.
    pub stance: Stance,
    /// Where the arm is, on the surface or off it. \[rad\] or \[m\]
    pub from: JointVector,
    /// Where it is to go; continuous joints come there by the shorter way. \[rad\] or \[m\]
    pub to: JointVector,
    /// Continuous joints are turned back to `to` itself at the end, by whole turns.
    pub unwinds: bool,
    /// How fast the plan goes along its path.
    pub profile: Profile,
    /// One velocity for all joints; `None`: the robot's limits. \[rad/s\]
    pub v_max: Option<f64>,
    /// Collision margins and meshes.
    pub collision: Options,
    /// Seed of the search.
    pub seed: u64,
}

/// The plan and what was found of it.
#[derive(Clone, Debug)]
pub struct TransitOutcome {
    /// The plan. It may be published if `verification.violations` is empty.
    pub plan: Plan,
    /// What verification found.
    pub verification: Verification,
    /// How near it comes to what is around it, at some places of the way; at most [`FARTHEST`].
    pub clearance: Clearance,
}

/// Farthest that a clearance is told. \[m\]
pub const FARTHEST: f64 = 0.5;
/// At how many places of a way the clearance is looked for.
const LOOKS: usize = 60;

/// How often the way is looked for, each time with other samples, so many at once.
const TRIES: u64 = 16;
const AT_ONCE: u64 = 4;
/// What counts as the same place. \[rad\] or \[m\]
const SAME: f64 = 1e-6;

/// Plans the way, lifting the tool off and setting it down where it touches the surface. The scene
/// is in the floor frame.
///
/// # Errors
/// See [`TransitError`]. A plan that breaks a rule is no error: its verification says so.
pub fn run(
    robot: &Robot,
    scene: &Scene,
    job: &Transit,
    progress: &dyn Progress,
) -> Result<TransitOutcome, TransitError> {
    progress.stage("way", None);
    let arm = job.stance.bind(&robot.arm(&job.arm)?)?;
    let here = scene.transformed(&job.stance.pose().inverse());
    let (points, obstacles) = (here.points(), &here.obstacles);
    let world = World::new(robot, &arm, &job.tool, points, obstacles, &job.collision)?;
    for note in world.notes() {
        progress.note(note);
    }
    if let Some(hit) = world.stance_hit() {
        return Err(TransitError::StanceHit { hit: hit.to_string() });
    }
    let cell = Workcell { arm: &arm, tool: &job.tool, world: &world };
    ends(cell, job)?;
    let is_there =
        arm.continuous().displacement(&job.from, &job.to).iter().all(|apart| apart.abs() <= SAME);
    if is_there && !(job.unwinds && job.from.distance(&job.to) > SAME) {
        return Err(TransitError::Arrived);
    }
    let mut way = if is_there { vec![job.from] } else { way(cell, job)? };
    if job.unwinds {
        unwind(cell, &mut way, &job.to)?;
    }
    let mut plan = assemble(robot, cell, &here, job, &way);
    if job.profile.is_curved() {
        let jerk = (job.profile == Profile::Jerk).then(|| timing::jerks(&arm));
        let pace = Pace { jerk, ..Pace::default() };
        plan = paced(&plan, cell, &Limits::of(&arm, job.v_max), &pace);
    }
    progress.stage("verify", Some(plan.knots.len()));
    let given = Given { robot, arm: &job.arm, scene, collision: &job.collision };
    let verification = verify(&plan, given, &|| progress.tick())?;
    let clearance = clearance(&plan, &world);
    Ok(TransitOutcome { plan, verification, clearance })
}

/// The best of the ways that are found first.
fn way(cell: Workcell<'_>, job: &Transit) -> Result<Vec<JointVector>, TransitError> {
    (0..TRIES / AT_ONCE)
        .find_map(|batch| {
            let seeds = (batch * AT_ONCE..(batch + 1) * AT_ONCE).into_par_iter();
            let ways: Vec<_> =
                seeds.map(|k| jump(cell, &job.from, &job.to, job.seed.wrapping_add(k))).collect();
            let cost = |way: &Vec<JointVector>| cost::of_path(&cost::Effort, way);
            ways.into_iter().flatten().min_by(|a, b| cost(a).total_cmp(&cost(b)))
        })
        .ok_or(TransitError::NoWay { tries: TRIES })
}

/// Turns one continuous joint after the other, from the tip on, to where it is to be, whole turns and all.
fn unwind(
    cell: Workcell<'_>,
    way: &mut Vec<JointVector>,
    to: &JointVector,
) -> Result<(), TransitError> {
    for j in (0..cell.arm.dof()).rev().filter(|&j| cell.arm.continuous().is(j)) {
        let Some(&last) = way.last() else { continue };
        let mut next = last;
        next[j] = to[j];
        let turns = ((next[j] - last[j]) / std::f64::consts::TAU).round();
        if turns == 0.0 {
            continue;
        }
        if !cell.world.motion_free(&last, &next, ToolContact::Forbidden) {
            let joint = cell.arm.joint_names()[j].clone();
            return Err(TransitError::Unwinding { joint, turns: turns.abs() as u32 });
        }
        way.push(next);
    }
    Ok(())
}

/// The least of arm and hand each, evenly over the joints' motion.
fn clearance(plan: &Plan, world: &World) -> Clearance {
    let apart = |k: &usize| plan.knots[*k].q.distance(&plan.knots[k - 1].q);
    let step = (1..plan.knots.len()).map(|k| apart(&k)).sum::<f64>() / LOOKS as f64;
    let looks: Vec<JointVector> = (1..plan.knots.len())
        .flat_map(|k| {
            let curve = plan.curve(k);
            let looks = (apart(&k) / step.max(SAME)).ceil().max(1.0) as usize;
            (0..=looks).map(move |i| curve.at(i as f64 / looks as f64)).collect::<Vec<_>>()
        })
        .collect();
    let all: Vec<Clearance> =
        looks.par_iter().map(|q| world.exact().clearance(q, FARTHEST)).collect();
    let least = |of: fn(&Clearance) -> f64| all.iter().map(of).fold(FARTHEST, f64::min);
    Clearance { arm: least(|c| c.arm), hand: least(|c| c.hand) }
}

/// Whether the arm may be at both ends: where it is, within the limits that the executor keeps, where
/// it is to go with their margin, and free of collision but for the pad.
fn ends(cell: Workcell<'_>, job: &Transit) -> Result<(), TransitError> {
    let arm = cell.arm;
    for (place, q) in [(Place::Here, &job.from), (Place::There, &job.to)] {
        for (j, name) in arm.joint_names().iter().enumerate() {
            let (low, high) = match place {
                Place::Here => arm.braking_limits(j, 0.0),
                Place::There => arm.margined_limits()[j],
            };
            if !(low..=high).contains(&q[j]) {
                let (joint, value) = (name.clone(), q[j]);
                return Err(TransitError::Limit { place, joint, value, low, high });
            }
        }
        if let Some(hit) = cell.world.why_not(q, ToolContact::Allowed) {
            return Err(TransitError::Hit { place, hit: hit.to_string() });
        }
    }
    Ok(())
}

/// The way as a plan with bang-bang velocity, which sweeps nothing.
fn assemble(
    robot: &Robot,
    cell: Workcell<'_>,
    here: &Scene,
    job: &Transit,
    way: &[JointVector],
) -> Plan {
    let Workcell { arm, tool, world } = cell;
    let mut knots: Vec<PlanKnot> = way.iter().map(|q| PlanKnot::free(*q)).collect();
    knots.dedup_by(|b, a| a.q == b.q);
    // Where it ends on the surface, the pad may touch while it is set down.
    if let Some(last) = knots.last_mut()
        && !world.is_free(&last.q, ToolContact::Forbidden)
    {
        last.line = Some(tool.on(arm).centre(&last.q).into());
    }
    timing::set_times(&mut knots, &cost::velocities(arm, job.v_max));
    let scan = &here.surface;
    let sample = |i: usize| SurfaceSample {
        point: scan.points[i].into(),
        normal: scan.normals[i].into_inner().into(),
        reachable: false,
    };
    Plan {
        base: job.stance.base,
        base_height: job.stance.height,
        seed: job.seed,
        surface: (0..scan.points.len()).map(sample).collect(),
        ..Plan::of(robot, arm, tool, knots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole turns make no way.
    #[test]
    fn a_whole_turn_away_is_there() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(nullsweep_robot::Side::Right)).expect("an arm");
        let job = |to| Transit {
            arm: arm.spec().clone(),
            tool: Tool::default(),
            stance: Stance { base: [0.0; 3], height: 0.0, held: Vec::new() },
            from: arm.home(),
            to,
            unwinds: false,
            profile: Profile::Velocity,
            v_max: None,
            collision: Options::default(),
            seed: 1,
        };
        let go = |to| run(&robot, &Scene::empty(), &job(to), &crate::progress::Silent);
        let turning = (0..arm.dof()).find(|&j| arm.continuous().is(j)).expect("a wrist");
        let mut turned = arm.home();
        turned[turning] += std::f64::consts::TAU;
        assert!(matches!(go(turned), Err(TransitError::Arrived)));
        turned[turning] += 0.5;
        let plan = go(turned).expect("a way").plan;
        let end = plan.knots.last().expect("knots").q;
        assert!((end[turning] - arm.home()[turning] - 0.5).abs() < 1e-9, "{end:?}");
    }
    /// … but where they are to be taken back.
    #[test]
    fn whole_turns_are_taken_back_where_that_is_asked_for() {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(nullsweep_robot::Side::Right)).expect("an arm");
        let turning: Vec<usize> = (0..arm.dof()).filter(|&j| arm.continuous().is(j)).collect();
        let mut from = arm.home();
        for (j, turns) in turning.iter().zip([2.0, -3.0]) {
            from[*j] += turns * std::f64::consts::TAU;
        }
        let job = Transit {
            arm: arm.spec().clone(),
            tool: Tool::default(),
            stance: Stance { base: [0.0; 3], height: 0.0, held: Vec::new() },
            from,
            to: arm.home(),
            unwinds: true,
            profile: Profile::Acceleration,
            v_max: None,
            collision: Options::default(),
            seed: 1,
        };
        let found = run(&robot, &Scene::empty(), &job, &crate::progress::Silent).expect("a way");
        let knots = &found.plan.knots;
        let ends = [(knots[0].q, from), (knots[knots.len() - 1].q, arm.home())];
        assert!(ends.iter().all(|(found, asked)| found.distance(asked) < 1e-9), "{ends:?}");
        assert!(found.verification.violations.is_empty());
    }
}
