//! Numbers on the command line: what is no sensible one is wrong usage, not a failure later on.

use std::str::FromStr;
use std::time::Duration;

use anyhow::Context;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use nullsweep_planner::plan;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::Stance;
use nullsweep_robot::Arm;

/// Any finite number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    within(text, f64::is_finite, "a finite number is wanted")
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    within(text, |v| v.is_finite() && v > 0.0, "a number above 0 is wanted")
}

/// A finite number of at least 0.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    within(text, |v| v.is_finite() && v >= 0.0, "a number of at least 0 is wanted")
}

/// A velocity. \[rad/s\] or \[m/s\]
pub(super) fn velocity(text: &str) -> Result<f64, String> {
    within(text, |v| (1e-3..=1e3).contains(&v), "0.001 to 1000 rad/s is wanted")
}

/// How long something may take, in seconds: up to a year.
pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    const YEAR: f64 = 366.0 * 86_400.0;
    let value = within(text, |v| (0.0..=YEAR).contains(&v), "0 s to a year is wanted")?;
    Ok(Duration::from_secs_f64(value))
}

fn within(text: &str, is_in: impl Fn(f64) -> bool, wanted: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|e| format!("{e}: {wanted}"))?;
    if is_in(value) { Ok(value) } else { Err(wanted.into()) }
}

/// A pose: x, y, z \[m\], qx, qy, qz, qw.
pub(super) fn isometry(&[x, y, z, qx, qy, qz, qw]: &[f64; 7]) -> anyhow::Result<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-6)
        .context("the quaternion must not be zero")?;
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// N comma-separated finite numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers<const N: usize>(pub(super) [f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let values: Vec<f64> = text
            .split(',')
            .map(|part| finite(part.trim()).map_err(|e| format!("`{part}`: {e}")))
            .collect::<Result<_, _>>()?;
        let numbers = values.try_into();
        numbers.map(Self).map_err(|v: Vec<f64>| format!("{} numbers, not {N}", v.len()))
    }
}

/// Where a frame is: x, y, z \[m\], and, if they are there, roll, pitch and yaw about the fixed axes, in
/// this order \[rad\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Offset(pub(super) Isometry3<f64>);

impl FromStr for Offset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let [x, y, z, roll, pitch, yaw] = match text.parse() {
            Ok(Numbers([x, y, z])) => [x, y, z, 0.0, 0.0, 0.0],
            Err(_) => text.parse::<Numbers<6>>().map_err(|e| format!("{e}, nor 3"))?.0,
        };
        let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        Ok(Self(Isometry3::from_parts(Translation3::new(x, y, z), rotation)))
    }
}

/// The position of a held joint: NAME=VALUE. \[rad\] or \[m\]
#[derive(Clone, Debug)]
pub(super) struct Held(pub(super) String, pub(super) f64);

impl FromStr for Held {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').ok_or("NAME=VALUE is wanted")?;
        Ok(Self(name.into(), finite(value).map_err(|e| format!("`{value}`: {e}"))?))
    }
}

/// Those of a plan's held joints that stand elsewhere than an arm has them by itself.
pub(super) fn moved(planned: &[plan::Held], arm: &Arm) -> Vec<(String, f64)> {
    let by_itself = |name: &str| arm.held_joints().iter().find(|held| held.name == name);
    let moved = planned.iter().filter(|held| {
        by_itself(&held.name).is_none_or(|own| own.position.to_bits() != held.position.to_bits())
    });
    moved.map(|held| (held.name.clone(), held.position)).collect()
}

/// Positions of held joints as they were given, the last of a name holds: the PR2's torso by its own flag
/// before what has its name.
pub(super) fn held(held: &[Held], torso: Option<f64>) -> Vec<(String, f64)> {
    let torso = torso.map(|height| ("torso_lift_joint".to_owned(), height));
    held.iter().map(|h| (h.0.clone(), h.1)).chain(torso).collect()
}

/// A share for people.
pub(super) fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// A place of the robot: x, y \[m\] and yaw \[rad\], or in degrees with `°` or `deg` behind it, as it is
/// told to people; and where it stands above the floor, its height \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) base: [f64; 3],
    pub(super) height: f64,
}

impl Place {
    /// The robot there, and its held joints.
    pub(super) fn stance(self, held: Vec<(String, f64)>) -> Stance {
        Stance { base: self.base, height: self.height, held }
    }

    /// Tells that the robot does not stand on the floor.
    pub(super) fn tell(&self, progress: &dyn Progress) {
        if self.height != 0.0 {
            progress.note(&format!(
                "the robot's root frame is {:.3} m above the floor; nothing stands for what it is \
                 raised by",
                self.height
            ));
        }
    }
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts: Vec<&str> = text.split(',').map(str::trim).collect();
        let degrees =
            parts.get(2).and_then(|yaw| ["°", "deg"].iter().find_map(|unit| before(yaw, unit)));
        if let Some(number) = degrees {
            parts[2] = number;
        }
        let numbers: Vec<&str> =
            parts.iter().map(|part| before(part, " m").unwrap_or(part)).collect();
        let (numbers, height) = match numbers[..] {
            [_, _, _, height] => {
                let height = finite(height).map_err(|e| format!("`{height}`: {e}"))?;
                (&numbers[..3], height)
            }
            _ => (&numbers[..], 0.0),
        };
        let Numbers([x, y, yaw]) = numbers.join(",").parse()?;
        let yaw = if degrees.is_some() { yaw.to_radians() } else { yaw };
        Ok(Self { base: [x, y, yaw], height })
    }
}

/// What stands before a unit.
fn before<'a>(text: &'a str, unit: &str) -> Option<&'a str> {
    text.strip_suffix(unit).map(str::trim_end)
}

#[test]
fn a_yaw_is_told_within_half_a_turn_and_read_as_it_is_told() {
    let place = [1.0, -0.5, 1.5 * std::f64::consts::PI];
    let told = nullsweep_planner::workcell::stance::told(&place);
    assert_eq!(told, "1.000 m, -0.500 m, -90.0°");
    let Place { base: [x, y, yaw], height } = told.parse().expect("a place");
    assert_eq!(height, 0.0);
    assert!((x, y) == (1.0, -0.5) && (yaw + std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    let at = |base, height| Ok(Place { base, height });
    assert_eq!("1,2,-0.5".parse(), at([1.0, 2.0, -0.5], 0.0));
    assert_eq!("1,2,180deg".parse(), at([1.0, 2.0, std::f64::consts::PI], 0.0));
    assert_eq!("1,2,-0.5,0.3".parse(), at([1.0, 2.0, -0.5], 0.3));
    assert_eq!("1 m, 2 m, 180°, 0.3 m".parse(), at([1.0, 2.0, std::f64::consts::PI], 0.3));
    for wrong in ["1,2", "1,2,°", "1,2,inf", "1,2,3,4,5", "1,2,3,", "1,2,3,nan"] {
        wrong.parse::<Place>().expect_err(wrong);
    }
    assert_eq!(percent(0.9871), "98.71 %");
}
