//! What a recording alone looks like: setpoints and what was measured, without a plan file.

use std::path::Path;

use nullsweep_report::{Headline, Look, ReportData, Tone};

use super::flight::Flight;
use super::headline::deviation;
use super::joint_axes;
use super::robot::{Posed, shapes};

/// The page of a recording.
pub(crate) fn recorded(
    file: &Path,
    flight: Flight,
    posed: Posed<'_>,
) -> anyhow::Result<ReportData> {
    let shown = shapes(posed, None)?;
    let arm = posed.arm;
    let plain = |label: &str, value, detail| Headline {
        label: label.into(),
        value,
        detail,
        tone: Tone::Plain,
    };
    let end = flight.commanded.times.last().copied().unwrap_or(0.0);
    let ran = match flight.ran {
        1 => "1 plan ran".into(),
        n => format!("{n} plans ran"),
    };
    let mut headline = vec![plain("Time", format!("{end:.1} s"), ran)];
    let largest = deviation(&flight, arm, 0.0);
    headline.extend(largest.map(|(value, detail)| plain("Largest deviation", value, detail)));
    let mut notes = vec![
        "The recording alone: the scene, what was swept and where the robot stood are in the plan's file."
            .to_owned(),
    ];
    let guessed = shown.shapes.iter().filter(|shape| shape.look == Look::Guessed);
    let mut guessed: Vec<&str> = guessed.map(|shape| shape.name.as_str()).collect();
    guessed.dedup();
    if !guessed.is_empty() {
        notes.push(format!("Guessed shapes: capsules stand for {}.", guessed.join(", ")));
    }
    if let Some(held) = arm.held_joints().first() {
        notes.push(format!(
            "Joints outside the arm are not in a recording: {} is drawn at {:.2}, the others at \
             their defaults too.",
            held.name, held.position
        ));
    }
    Ok(ReportData {
        title: "Nullsweep flight recording".into(),
        subtitle: format!("{}, {}", file.display(), posed.robot.name()),
        headline,
        notes,
        shapes: shown.shapes,
        bodies: shown.bodies,
        pad: Some(shown.pad),
        joints: joint_axes(arm),
        plans: vec![flight.commanded],
        measured: vec![flight.measured],
        ..ReportData::default()
    })
}
