//! What to try when a command fails. The libraries say what is wrong; the flags that mend it are
//! known only here.

use std::error::Error;

use nullsweep_collision::{CollisionError, MeshError};
use nullsweep_ipc_types::{Mode, Reason};
use nullsweep_planner::follow::FollowError;
use nullsweep_planner::link::journal::JournalError;
use nullsweep_planner::link::posture::PostureError;
use nullsweep_planner::link::publish::PublishError;
use nullsweep_planner::link::replan::ReplanError;
use nullsweep_planner::pipeline::PipelineError;
use nullsweep_planner::plan::PlanError;
use nullsweep_planner::poses::SetupError;
use nullsweep_planner::regions::RegionError;
use nullsweep_planner::task::TaskError;
use nullsweep_planner::transit::{Place, TransitError};
use nullsweep_planner::verify::VerifyError;
use nullsweep_surface::ScanError;
use nullsweep_surface::register::RegisterError;
use nullsweep_surface::room::LevelError;
use nullsweep_surface::scan::ScanWarning;

use crate::program_error::{Astray, Off, Within};
use crate::send::{Elsewhere, HeldElsewhere, Stopped};

/// A line of advice for an error, where a flag can help: that of the outermost cause with any.
pub(super) fn advice(error: &anyhow::Error) -> Option<String> {
    if let Some(within) = error.downcast_ref::<Within>() {
        return Some(within_program(within, error));
    }
    error.chain().find_map(known)
}

fn known(error: &(dyn Error + 'static)) -> Option<String> {
    if let Some(error) = error.downcast_ref() {
        scan(error)
    } else if let Some(error) = error.downcast_ref() {
        pipeline(error)
    } else if let Some(error) = error.downcast_ref() {
        task(error)
    } else if let Some(error) = error.downcast_ref() {
        follow(error)
    } else if let Some(error) = error.downcast_ref() {
        plan(error)
    } else if let Some(error) = error.downcast_ref() {
        publish(error)
    } else if let Some(error) = error.downcast_ref() {
        replan(error)
    } else if let Some(error) = error.downcast_ref() {
        collision(error)
    } else if let Some(error) = error.downcast_ref() {
        Some(register(error).into())
    } else if let Some(error) = error.downcast_ref() {
        Some(elsewhere(error))
    } else if let Some(error) = error.downcast_ref() {
        Some(stopped(error))
    } else if let Some(error) = error.downcast_ref() {
        Some(held_elsewhere(error))
    } else if let Some(error) = error.downcast_ref() {
        transit(error)
    } else if let Some(error) = error.downcast_ref() {
        posture(error)
    } else if let Some(VerifyError::OtherRegions { .. }) = error.downcast_ref() {
        Some("give --regions as it was given to `plan`".into())
    } else if let Some(RegionError::Nothing { .. }) = error.downcast_ref() {
        Some(
            "its shapes are in the floor frame, which `planner scene` shows, or by frame = \"scan\" in \
             the first scan file's own"
                .into(),
        )
    } else if let Some(error) = error.downcast_ref() {
        journal(error).map(Into::into)
    } else if let Some(LevelError::NoPlane { .. }) = error.downcast_ref() {
        Some(
            "say how the scan stands: --up X,Y,Z (against gravity, in the file's frame) with \
             --sensor-height M, or --sensor-pose"
                .into(),
        )
    } else {
        None
    }
}

fn scan(error: &ScanError) -> Option<String> {
    let text = match error {
        ScanError::EmptyCrop { .. } => {
            "widen --crop, or check with --sensor-pose or --up where the scan stands"
        }
        ScanError::NoSurface { .. } => {
            "--scale takes the file's unit to metres: 0.001 for millimetres"
        }
        _ => return None,
    };
    Some(text.into())
}

fn register(error: &RegisterError) -> &'static str {
    match error {
        RegisterError::Overlap { .. } => {
            "give each scan its --sensor-pose to within some 5 cm and 5\u{b0}; --as-placed takes the \
             scans as they are placed, also where they share nothing"
        }
        _ => {
            "give a better --sensor-pose for this scan, or leave it out; --as-placed takes it as it is \
             placed"
        }
    }
}

/// The same for what a scan merely warns of.
pub(super) fn on_warning(warning: &ScanWarning) -> Option<&'static str> {
    matches!(warning, ScanWarning::LooksLikeMillimetres { .. })
        .then_some("--scale 0.001 reads millimetres")
}

fn pipeline(error: &PipelineError) -> Option<String> {
    let text = match error {
        PipelineError::NoPatches { .. } => {
            "--scale takes the file's unit to metres; else try a larger --patch-radius"
        }
        PipelineError::NoStance { .. } => {
            "try another height with --torso, or say where the robot stands: --base x,y,yaw; where \
             unseen space is in the way, add a scan from another side, or take it for free with \
             --unseen free"
        }
        PipelineError::StanceHit { .. } => {
            "choose another --base; space that no scan has seen counts as free with --unseen free"
        }
        PipelineError::StartHit { .. }
        | PipelineError::StartLimit { .. }
        | PipelineError::NoMotion { .. } => "give another --start",
        PipelineError::NothingReached { .. } => {
            "--base auto looks for where the robot reaches most"
        }
        PipelineError::NoSuchKnot { knots, .. } => {
            return Some(format!(
                "--continue PLAN@K takes K from 0 to {}",
                knots.saturating_sub(1)
            ));
        }
        PipelineError::Collision(error) => return collision(error),
        _ => return None,
    };
    Some(text.into())
}

fn task(error: &TaskError) -> Option<String> {
    match error {
        TaskError::NothingMet { .. } => Some(NOTHING_MET.into()),
        TaskError::NoWay { .. } => Some(ANOTHER_START.into()),
        TaskError::Setup(error) => setup(error),
        _ => None,
    }
}

fn follow(error: &FollowError) -> Option<String> {
    match error {
        FollowError::NothingMet { .. } => Some(NOTHING_MET.into()),
        FollowError::NoWay { .. } => Some(ANOTHER_START.into()),
        FollowError::Setup(error) => setup(error),
        FollowError::Verify(_) => None,
    }
}

fn setup(error: &SetupError) -> Option<String> {
    match error {
        SetupError::StanceHit { .. } => Some(STANDS_IN.into()),
        SetupError::Start { .. } => Some(ANOTHER_START.into()),
        SetupError::Collision(error) => collision(error),
        SetupError::Arm(_) => None,
    }
}

/// Where given poses are out of reach, where no way leads to them, and where the robot stands in
/// something.
const NOTHING_MET: &str = "--arm BASE,TIP names the tip link, --offset moves the poses, --quat wxyz \
                           reads quaternions with the scalar first; --floor says how high the floor is";
const ANOTHER_START: &str = "give another --start";
const STANDS_IN: &str = "--base says where in the scene the robot stands; space that no scan has seen \
                         counts as free with --unseen free";

fn plan(error: &PlanError) -> Option<String> {
    let text = match error {
        PlanError::Parse { .. } => "`planner plan` makes a plan file",
        PlanError::IsProgram { .. } => {
            "`planner inspect PROGRAM --plans FOLDER` writes each of its plans as a file of its own"
        }
        PlanError::TooLong { .. } => "plan fewer patches at once: --crop keeps a part of the scan",
        _ => return None,
    };
    Some(text.into())
}

fn publish(error: &PublishError) -> Option<String> {
    let text = match error {
        PublishError::ContinuesNothing => {
            "make the plan with `planner plan --continue PLAN@K`, or publish it with --join stop"
        }
        PublishError::NothingRuns => {
            "`planner publish --join stop` sends a plan to an idle arm; after a stop `planner replan \
             --running PLAN` plans what it has left, from where the arm stands"
        }
        PublishError::EndedEarly(event) if event.reason == Reason::Stopped.wire() => {
            "`planner replan --running PLAN SCAN…` goes on with what it has left, with the scans and \
             their flags as they were given to `plan`"
        }
        PublishError::Rejected(event) if event.reason == Reason::Speed.wire() => {
            "it takes over from a plan that runs; once that has ended or was stopped, `planner replan \
             --running THAT` plans anew from where the arm stands"
        }
        PublishError::EndedEarly(event) if event.reason == Reason::HeldJoint.wire() => {
            "keep torso and other arm still while the arm moves"
        }
        PublishError::Rejected(event) if event.reason == Reason::HeldJoint.wire() => {
            "move it there, or plan for where it stands: `held` in the cell, --held, --torso"
        }
        PublishError::Lost(_) => {
            "see the executor's last lines for why; it starts no plan from before its own start, so \
             publish again, or `planner replan`, once `executor ctl status` answers; behind a relay \
             `relay ask PLAN` says what became of it"
        }
        PublishError::Rejected(event) if event.reason == Reason::Start.wire() => {
            "only a plan of `planner replan`, or of `planner plan --continue PLAN@K`, takes over in \
             motion; any other one once the arm rests at its start: `planner goto --plan PLAN`"
        }
        PublishError::Rejected(event) if event.reason == Reason::NotReady.wire() => {
            "`executor ctl status` says why: a fault, which `executor ctl reset` clears once its cause is \
             gone, or an endpoint that does not run"
        }
        PublishError::Plan(error) => return plan(error),
        _ => return None,
    };
    Some(text.into())
}

fn held_elsewhere(error: &HeldElsewhere) -> String {
    let HeldElsewhere { joints, plan } = error;
    let stand = joints.iter().map(|j| format!("--held {}={:.4}", j.name, j.stands));
    let stand: Vec<String> = stand.collect();
    let mock = plan.as_ref().map_or(String::new(), |plan| {
        format!(" (`mock-hardware --plan {}` stands so)", plan.display())
    });
    format!(
        "bring them there by the robot's own controls{mock}, or plan for where they stand: {}",
        stand.join(" ")
    )
}

fn stopped(error: &Stopped) -> String {
    match &error.plan {
        Some(plan) => format!(
            "`planner replan --running {} SCAN…` goes on from where the arm stands with what is left, with \
             the scans and their flags as they were given to `plan`",
            plan.display()
        ),
        None => "`planner goto` again goes on from where the arm stands".into(),
    }
}

fn journal(error: &JournalError) -> Option<&'static str> {
    match error {
        JournalError::Open { .. } => Some("--resume goes on with it; to begin anew, remove it"),
        JournalError::OtherProgram { .. } => Some("--journal names another one; or remove it"),
        JournalError::None { .. } => Some("without --resume the program is begun"),
        _ => None,
    }
}

/// What goes on with a program that was left on its way.
fn within_program(within: &Within, error: &anyhow::Error) -> String {
    let first = match (error.downcast_ref::<Astray>(), error.downcast_ref::<Off>()) {
        (Some(Astray::Drive { .. }), _) => {
            "bring it there: `planner goto --plan PLAN SCAN…`, with a plan of this arm that `planner inspect \
             PROGRAM --plans FOLDER` writes; then "
        }
        (Some(Astray::Unseen { .. }), _) => "say what is around it: ",
        (_, Some(_)) => "drive it nearer, or allow more by --base-off; then ",
        _ if error.is::<HeldElsewhere>() => "set them by the robot's own controls; then ",
        _ => "once the cause is gone, ",
    };
    let program = within.program.display();
    format!(
        "{first}`planner publish {program} --resume SCAN…` goes on with what is left, with the scans and their \
         flags as they were given to `plan`"
    )
}

fn replan(error: &ReplanError) -> Option<String> {
    let text = match error {
        ReplanError::Publish(error) => return publish(error),
        ReplanError::Ends { .. } => {
            "a shorter --lead takes over sooner, and has the arm stopped where planning takes longer; or \
             let the plan end and make another one"
        }
        ReplanError::Idle => {
            "`planner publish PLAN` runs a plan from its start; --from K goes on from where the arm \
             stands with what the plan has not swept by its knot K"
        }
        ReplanError::Moved(_) => {
            "--running names the plan that was stopped; --from K goes on from where the arm stands, \
             wherever that is, with what the plan has not swept by its knot K"
        }
        ReplanError::OtherPlan(_) => "--running names the plan that runs: `executor ctl status`",
        ReplanError::Runs => "leave out --from, or stop the arm first: `executor ctl stop`",
        ReplanError::NotHeld(mode) => return posture(&PostureError::NotHeld(*mode)),
        _ => return None,
    };
    Some(text.into())
}

fn elsewhere(error: &Elsewhere) -> String {
    let plan = error.plan.as_ref().map_or("PLAN".into(), |plan| plan.display().to_string());
    if error.stopped {
        return format!(
            "`planner replan --running {plan} SCAN…` goes on from where the arm was stopped with what is \
             left; `planner publish {plan} SCAN… --goto` begins anew, with the scans and their flags as \
             they were given to `plan`"
        );
    }
    format!(
        "`planner goto --plan {plan} SCAN…` brings it there, with the scans and their flags as they \
         were given to `plan`; `planner publish {plan} SCAN… --goto` does both"
    )
}

fn transit(error: &TransitError) -> Option<String> {
    let text = match error {
        TransitError::Hit { place: Place::Here, .. }
        | TransitError::Limit { place: Place::Here, .. } => {
            "move the arm to where it is free, by its own controls; where only unseen space is in the \
             way, --unseen free takes it for free"
        }
        TransitError::Hit { .. } | TransitError::Limit { .. } => "choose another posture",
        TransitError::StanceHit { .. } => {
            "say where it stands: --base, or --plan PLAN; space that no scan has seen counts as free \
             with --unseen free"
        }
        TransitError::NoWay { .. } => "go by way of another posture, or try another --seed",
        TransitError::Collision(error) => return collision(error),
        _ => return None,
    };
    Some(text.into())
}

fn posture(error: &PostureError) -> Option<String> {
    let text = match error {
        PostureError::NotHeld(Mode::Executing | Mode::Stopping | Mode::Paused) => {
            "wait for the plan's end, or `executor ctl stop`"
        }
        PostureError::NotHeld(Mode::Fault) => {
            "`executor ctl status` tells the fault, `reset` clears it"
        }
        PostureError::NotHeld(_) => "is the endpoint running? `executor ctl status` tells more",
        PostureError::OtherArm { .. } => {
            "--urdf and --arm name the arm, as they do for the executor"
        }
        PostureError::Publish(error) => return publish(error),
        PostureError::Ipc(_) => return None,
    };
    Some(text.into())
}

fn collision(error: &CollisionError) -> Option<String> {
    let folder = |error: &MeshError| match error {
        MeshError::UnknownPackage { package, .. } => {
            Some(format!("--package {package}=FOLDER says where its meshes are"))
        }
        _ => None,
    };
    match error {
        CollisionError::Mesh { error, .. } => {
            const CAPSULES: &str = "--fit-capsules RADIUS puts capsules in place of missing meshes";
            Some(folder(error).map_or(CAPSULES.into(), |folder| format!("{folder}; {CAPSULES}")))
        }
        CollisionError::ObstacleMesh { error, .. } => folder(error),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use anyhow::Context;
    use bytemuck::Zeroable as _;
    use nullsweep_ipc_types::PlanEvent;

    use super::*;

    fn of(error: impl Into<anyhow::Error>) -> String {
        advice(&error.into()).expect("advice")
    }

    #[test]
    fn a_plan_that_comes_too_early_says_what_may_be_missing() {
        let event = |reason: Reason| {
            let event = PlanEvent { reason: reason.wire(), ..PlanEvent::zeroed() };
            PublishError::Rejected(Box::new(event))
        };
        assert!(of(event(Reason::NotReady)).contains("endpoint"));
        assert!(of(event(Reason::Start)).contains("`planner replan`"));
        assert!(of(event(Reason::HeldJoint)).contains("--held"));
        assert_eq!(advice(&event(Reason::Velocity).into()), None);
    }

    #[test]
    fn it_is_found_through_errors_and_contexts_around_the_cause() {
        let mesh = || CollisionError::Mesh {
            link: "hand".into(),
            error: MeshError::UnknownPackage {
                package: "gripper".into(),
                file: "palm.stl".into(),
                looked: "nowhere else".into(),
            },
        };
        for advice in [
            of(mesh()),
            of(PipelineError::from(mesh())),
            of(TaskError::from(SetupError::from(mesh()))),
        ] {
            assert!(advice.starts_with("--package gripper=FOLDER"), "{advice}");
            assert!(advice.contains("--fit-capsules"), "{advice}");
        }
        let plan = || PlanError::TooLong { found: 9 };
        assert!(of(PublishError::from(plan())).contains("--crop"));
        assert!(of(ReplanError::from(PublishError::from(plan()))).contains("--crop"));
        let context = Err::<(), _>(plan()).context("while publishing").unwrap_err();
        assert!(of(context).contains("--crop"));
    }

    #[test]
    fn there_is_none_where_no_flag_helps() {
        assert_eq!(advice(&anyhow::anyhow!("the disk is full")), None);
        assert_eq!(advice(&PublishError::NoTelemetry.into()), None);
    }
}
