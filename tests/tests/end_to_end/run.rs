//! Plans that run to their end, and plans that take another's place.

use nullsweep_ipc_types::{CommandKind, EventKind, Mode, Reason, Verdict};
use nullsweep_robot::MAX_DOF;
use nullsweep_tests::sketch::{Sketch, swung};

use crate::rig::Rig;

#[test]
fn a_plan_runs_to_its_end() {
    let mut rig = Rig::start();
    let sketch = rig.swings(2.0);
    let plan = rig.run(&sketch);
    rig.ends(plan, EventKind::Finished);
    let held = rig.witness.mode(Mode::Hold).expect("it holds");
    for j in 0..rig.arm.dof() {
        assert_eq!(held.commanded[j], rig.arm.home()[j], "the last knot is hit exactly");
    }
    let found = rig.verdict();
    assert_eq!(found["verdict"]["sessions"], 1);
    assert_eq!(plans(&found), [plan.to_string()]);
    assert!(found["verdict"]["setpoints"].as_u64() > Some(2000), "{found:#}");
}

#[test]
fn a_plan_is_swapped_at_a_knot_without_a_stop() {
    let mut rig = Rig::start();
    let first = rig.swings(8.0);
    let old = rig.run(&first);
    // Two seconds ahead.
    let knot = rig.witness.see("motion", |t| t.plan == old).expect("it moves").knot + 40;
    let from = first.posture(knot as usize);
    let second = Sketch::through(&rig.arm, &[from, swung(&rig.arm, &rig.arm.home(), 0.2)], 0.1);
    let new = rig.run(&second.at_knot(old, knot));
    rig.ends(old, EventKind::Superseded);
    rig.ends(new, EventKind::Finished);
    let found = rig.verdict();
    assert_eq!(plans(&found), [old.to_string(), new.to_string()]);
    let join = &runs(&found)[1];
    // Without a stop: the arm was moving when the second plan took over.
    assert!(join["join_step_ratio"].as_f64() > Some(0.0), "{join}");
}

#[test]
fn a_plan_is_swapped_by_a_stop() {
    let mut rig = Rig::start();
    let old = rig.run(&rig.swings(8.0));
    // Where the arm will have stopped is known only afterwards, so: stop, look, publish.
    let answer = rig.witness.command(CommandKind::Stop, 0.0).expect("an answer");
    assert_eq!(answer.verdict, Verdict::Accepted.wire());
    let end = rig.ends(old, EventKind::Aborted);
    assert_eq!(end.reason, Reason::Stopped.wire());
    let held = rig.witness.mode(Mode::Hold).expect("it holds");
    let mut from = rig.arm.home();
    from.copy_from_slice(&held.commanded[..MAX_DOF]);
    let second = Sketch::through(&rig.arm, &[from, rig.arm.home()], 0.1);
    let new = rig.run(&second);
    rig.ends(new, EventKind::Finished);
    let found = rig.verdict();
    assert!(plans(&found).ends_with(&[new.to_string()]), "{found:#}");
}

#[test]
fn a_second_plan_stops_the_first_and_starts_where_it_held() {
    let mut rig = Rig::start();
    // Out slowly by 0.1 rad and back to within the start tolerance of home, so that wherever the
    // first plan is stopped, the second one's start is near.
    let near = swung(&rig.arm, &rig.arm.home(), 0.008);
    let postures: Vec<_> =
        (0..200).map(|k| if k % 2 == 0 { rig.arm.home() } else { near }).collect();
    let old = rig.run(&Sketch::through(&rig.arm, &postures, 0.05));
    let second = Sketch::through(&rig.arm, &[rig.arm.home(), swung(&rig.arm, &near, 0.1)], 0.1);
    let new = rig.publish(&second);
    let end = rig.ends(old, EventKind::Superseded);
    assert_eq!(end.plan, old);
    rig.ends(new, EventKind::Finished);
    let found = rig.verdict();
    assert_eq!(plans(&found).last(), Some(&new.to_string()));
}

#[test]
fn pause_and_resume_keep_the_plan() {
    let mut rig = Rig::start();
    let plan = rig.run(&rig.swings(3.0));
    rig.witness.command(CommandKind::Pause, 0.0).expect("an answer");
    let paused = rig.witness.mode(Mode::Paused).expect("it pauses");
    assert_eq!(paused.plan, plan);
    rig.witness.command(CommandKind::Resume, 0.0).expect("an answer");
    rig.ends(plan, EventKind::Finished);
    rig.verdict();
}

/// The plans that moved the arm, in order.
fn plans(found: &serde_json::Value) -> Vec<String> {
    runs(found).iter().filter_map(|r| r["plan"].as_str()).map(String::from).collect()
}

/// The runs of setpoints that belong to a plan.
fn runs(found: &serde_json::Value) -> Vec<serde_json::Value> {
    let all = found["verdict"]["plans"].as_array().expect("the verdict lists the plans");
    all.iter().filter(|r| r["plan"] != "0/0").cloned().collect()
}
