//! The scan that a command works on, from files or simulated, in the floor frame.

use std::path::PathBuf;
use std::str::FromStr;

use anyhow::{Context, ensure};
use clap::Args;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_collision::Obstacle;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::Geometry;
use nullsweep_surface::{
    CleanConfig, CropBox, PlacedScan, Placement, RawScan, ReadOptions, Scan, scan, simulate,
};

use crate::advice;
use crate::bars::Bars;
use crate::numbers::{Numbers, finite, not_negative, positive};
use crate::room::{self, ObjectChoice, TABLE_TOP};
use crate::views;

/// How the scans stand and what of them is swept.
#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Pose of a scan's sensor in the floor frame: x,y,z,qx,qy,qz,qw; once for each scan.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    sensor_pose: Vec<Numbers<7>>,
    /// Direction against gravity in the scans' frame: x,y,z.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with = "sensor_pose")]
    up: Option<Numbers<3>>,
    /// Take several scans as they are placed, without laying each onto those before it.
    #[arg(long)]
    as_placed: bool,
    /// Height of the sensor above what the object stands on. [m]
    #[arg(long, value_name = "M", requires = "up", value_parser = finite)]
    sensor_height: Option<f64>,
    /// Height above the floor of what the object stands on; above 0 it becomes a table. [m]
    #[arg(long, value_name = "M", default_value_t = 0.0, value_parser = not_negative)]
    support_height: f64,
    /// Size of that table's top, along x and y of the floor frame, the object in its middle; without
    /// it the table is taken to reach 0.45 m beyond the object on every side. [m]
    #[arg(long, value_name = "LxW", requires = "support_height")]
    table: Option<TableSize>,
    /// What the space that no view has seen is: kept clear of, or taken for free.
    #[arg(long, value_enum, default_value = "avoid")]
    unseen: UnseenArg,
    /// Factor from the file's unit to metres: 0.001 for millimetres.
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    scale: f64,
    /// Keep only this box of the floor frame as the surface to sweep, the rest stays an obstacle:
    /// xmin,ymin,zmin,xmax,ymax,zmax.
    #[arg(long, value_name = "BOX", allow_hyphen_values = true)]
    crop: Option<CropBox>,
    /// Sweep only this object of the scene, by its number from `planner scene`, or the one with the
    /// most points: N or `largest`. Without --up, --sensor-pose: gravity is found by the largest level
    /// plane.
    #[arg(long, value_name = "OBJECT", conflicts_with = "crop")]
    object: Option<ObjectChoice>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Demo {
    /// A kitchen chair.
    Chair,
    /// The chair's seat alone; the rest of it is an obstacle.
    ChairSeat,
    /// A ride-on toy car.
    BobbyCar,
}

/// What becomes of the space that no view has seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum UnseenArg {
    /// Nothing of robot or tool comes deeper than 2 cm into it.
    Avoid,
    /// It is free.
    Free,
}

/// Length and width of a table top. [m]
#[derive(Clone, Copy, Debug)]
struct TableSize([f64; 2]);

impl FromStr for TableSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (length, width) = text.split_once('x').ok_or("LxW is wanted, 1.2x0.8 say")?;
        let side = |text: &str| match text.trim().parse::<f64>() {
            Ok(side) if side > 0.0 && side.is_finite() => Ok(side),
            _ => Err(format!("`{text}` is no length in metres")),
        };
        Ok(Self([side(length)?, side(width)?]))
    }
}

/// Reads and joins the scans, or simulates `demo`'s with the noise of `seed`, and cleans them.
pub(super) fn scene(
    args: &SceneArgs,
    demo: Option<Demo>,
    scans: &[PathBuf],
    seed: u64,
    bars: &Bars,
) -> anyhow::Result<Scene> {
    let (mut scene, flying) = if let Some(choice) = args.object {
        ensure!(demo.is_none(), "--object chooses from a scan, not from a demo");
        let placed = read_scans(args, scans, seed, Gravity::Found, bars)?;
        room::object(&placed, choice, seed, bars)?
    } else {
        let (placed, region) = match demo {
            Some(demo) => simulated(demo, seed),
            None => (read_scans(args, scans, seed, Gravity::Given, bars)?, None),
        };
        let region = args.crop.or(region);
        Scene::seen(&placed, region.as_ref(), &CleanConfig::default())?
    };
    if !flying.is_empty() {
        let flying = flying.len();
        bars.note(&format!("{flying} points fly alone and are taken for nothing"));
    }
    if args.unseen == UnseenArg::Free && !scene.unseen.is_empty() {
        scene.unseen.clear();
        bars.note("space that no view has seen counts as free");
    }
    if args.support_height > 0.0 {
        if args.table.is_none() {
            bars.note(
                "the table is taken to reach 0.45 m beyond the object on every side: --table LxW \
                 gives its size",
            );
        }
        scene.obstacles.push(table_under(&scene.surface, args.support_height, args.table));
    }
    Ok(scene)
}

fn simulated(demo: Demo, seed: u64) -> (PlacedScan, Option<CropBox>) {
    let (view, region) = match demo {
        Demo::Chair => (simulate::chair(seed), None),
        Demo::ChairSeat => (simulate::chair(seed), Some(simulate::chair_seat())),
        Demo::BobbyCar => (simulate::bobby_car(seed), None),
    };
    (scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose)).0, region)
}

/// Who says which way is up and how high the sensor is, where arguments leave it open.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Gravity {
    /// Up is z, and the lowest point rests on the support.
    Given,
    /// The largest level plane of the first scan.
    Found,
}

/// Reads, places and joins the scans, with a note for all that had to be guessed.
pub(super) fn read_scans(
    args: &SceneArgs,
    scans: &[PathBuf],
    seed: u64,
    gravity: Gravity,
    bars: &Bars,
) -> anyhow::Result<PlacedScan> {
    ensure!(
        args.sensor_pose.is_empty() || args.sensor_pose.len() == scans.len(),
        "{} scans but {} sensor poses: give one --sensor-pose for each scan, in their order",
        scans.len(),
        args.sensor_pose.len()
    );
    let options = ReadOptions { scale: args.scale, seed, ..ReadOptions::default() };
    let mut files = Vec::with_capacity(scans.len());
    for path in scans {
        let raw = scan::read(path, &options)?;
        for warning in &raw.warnings {
            let advice = advice::on_warning(warning).map(|advice| format!(" ({advice})"));
            bars.note(&format!("{}: {warning}{}", path.display(), advice.unwrap_or_default()));
        }
        files.push((path, raw));
    }
    let mut shared = None;
    if args.sensor_pose.is_empty() {
        // All files share the frame of the first one.
        shared = Some(together(args, &files, seed, gravity, bars)?);
    }
    let mut joined = PlacedScan::default();
    for (i, (path, raw)) in files.into_iter().enumerate() {
        let placement = match (args.sensor_pose.get(i), &shared) {
            (Some(pose), _) => Placement::SensorPose(isometry(pose)?),
            (None, Some(shared)) => shared.clone(),
            (None, None) => upright(args)?,
        };
        let (mut placed, _) = scan::place(&raw, &placement);
        // A file with normals is a model or has been through a program that laid it in place.
        if i > 0 && !args.as_placed && raw.normals.is_none() {
            views::lay(&joined, &mut placed, path, bars)?;
        }
        joined.join(placed);
    }
    Ok(joined)
}

/// The one placement of files that share a frame.
fn together(
    args: &SceneArgs,
    files: &[(&PathBuf, RawScan)],
    seed: u64,
    gravity: Gravity,
    bars: &Bars,
) -> anyhow::Result<Placement> {
    let Some((path, first)) = files.first() else { return upright(args) };
    let placement = match gravity {
        Gravity::Found if args.sensor_height.is_none() => leveled(args, first, seed, bars)?,
        _ => upright(args)?,
    };
    // What is lowest of all files rests on the support.
    let whole = match placement {
        Placement::Up { .. } if files.len() > 1 => {
            let points = files.iter().flat_map(|(_, raw)| raw.points.iter().copied()).collect();
            &RawScan { points, normals: None, ..first.clone() }
        }
        _ => first,
    };
    let below = scan::below_support(whole, &placement);
    if below > 0 {
        let path = path.display();
        bars.note(&format!("{path}: {below} points alone below all others: nothing rests on them"));
    }
    let (placed, pose) = scan::place(whole, &placement);
    Ok(Placement::Frame { pose, sensor: placed.views[0].sensor })
}

/// The direction that `--up` gives.
fn up(args: &SceneArgs) -> anyhow::Result<Option<UnitVector3<f64>>> {
    let unit = |Numbers(v): Numbers<3>| {
        UnitVector3::try_new(Vector3::from(v), 1e-6).context("--up must not be the zero vector")
    };
    args.up.map(unit).transpose()
}

/// The placement by the largest level plane of a scan.
fn leveled(args: &SceneArgs, raw: &RawScan, seed: u64, bars: &Bars) -> anyhow::Result<Placement> {
    let level = room::level(raw, up(args)?, seed)?;
    let [x, y, z] = level.up.into_inner().into();
    bars.note(&format!(
        "up is {x:.4},{y:.4},{z:.4} and the file's origin {:.3} m above what things stand on, by a \
         level plane of which {:.2} m² are seen",
        level.height, level.area
    ));
    let support_height = args.support_height;
    let placement =
        Placement::UpAndHeight { up: level.up, sensor_height: level.height, support_height };
    if level.camera {
        return Ok(placement);
    }
    bars.note("the file's origin is no camera: which side of a surface is outside is voted for");
    let (_, pose) = scan::place(raw, &placement);
    Ok(Placement::Frame { pose, sensor: None })
}

fn upright(args: &SceneArgs) -> anyhow::Result<Placement> {
    let up = up(args)?.unwrap_or(Vector3::z_axis());
    Ok(match args.sensor_height {
        Some(sensor_height) => {
            Placement::UpAndHeight { up, sensor_height, support_height: args.support_height }
        }
        None => Placement::Up { up, support_height: args.support_height },
    })
}

fn isometry(&Numbers([x, y, z, qx, qy, qz, qw]): &Numbers<7>) -> anyhow::Result<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), 1e-6)
        .context("--sensor-pose: the quaternion must not be zero")?;
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

/// How far a table top of unknown size is taken to reach beyond the object. [m]
const TABLE_RIM: f64 = 0.45;

/// A table top under the scan.
fn table_under(scan: &Scan, height: f64, size: Option<TableSize>) -> Obstacle {
    let mut low = Point3::new(f64::INFINITY, f64::INFINITY, height - TABLE_TOP);
    let mut high = Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, height);
    for p in &scan.points {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    for axis in 0..2 {
        let half = 0.5 * (high[axis] - low[axis]);
        let grow = size.map_or(TABLE_RIM, |TableSize(sides)| 0.5 * sides[axis] - half);
        low[axis] -= grow;
        high[axis] += grow;
    }
    Obstacle {
        name: "table".into(),
        shape: Geometry::Box { half_extents: (high - low) * 0.5 }.into(),
        pose: Isometry3::from(nalgebra::center(&low, &high).coords),
        carries_robot: false,
    }
}
