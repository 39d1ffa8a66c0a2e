//! Scan files in the floor frame, joined.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;
use nalgebra::{Point3, UnitVector3, Vector3};
use nullsweep_planner::progress::Progress;
use nullsweep_surface::room;
use nullsweep_surface::scan::ScanWarning;
use nullsweep_surface::{PlacedScan, Placement, RawScan, ReadOptions, scan};

use crate::advice;
use crate::bars::Bars;
use crate::floor::Placed;
use crate::numbers::{Numbers, finite, isometry, not_negative, positive};
use crate::scene_file::SceneFile;
use crate::views;

/// How the scans stand.
#[derive(Clone, Debug, Args)]
pub(super) struct PlacedArgs {
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
    pub(super) support_height: f64,
    /// Factor from the file's unit to metres: 0.001 for millimetres.
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    pub(super) scale: f64,
}

/// Who says which way is up and how high the sensor is, where arguments leave it open.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Gravity {
    /// Up is z, and the lowest point rests on the support.
    Given,
    /// The largest level plane of the first scan.
    Found,
}

/// Reads, places and joins the scans, with a note for all that had to be guessed; or takes a scene
/// file at its word.
pub(super) fn read_scans(
    args: &PlacedArgs,
    scans: &[PathBuf],
    seed: u64,
    gravity: Gravity,
    bars: &Bars,
) -> anyhow::Result<Placed> {
    if let [path] = scans
        && path.extension().is_some_and(|extension| extension == "toml")
    {
        let given = args.up.is_some() || !args.sensor_pose.is_empty() || args.scale != 1.0;
        ensure!(
            !given,
            "{}: a scene file says how its scans stand: leave out --up, --sensor-pose and --scale",
            path.display()
        );
        return SceneFile::read(path);
    }
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
    let (mut joined, mut poses) = (PlacedScan::default(), Vec::with_capacity(files.len()));
    for (i, (path, raw)) in files.into_iter().enumerate() {
        let placement = match &shared {
            Some(shared) => shared.clone(),
            None => {
                Placement::SensorPose(isometry(&args.sensor_pose[i].0).context("--sensor-pose")?)
            }
        };
        let (mut placed, mut pose) = scan::place(&raw, &placement);
        // A file with normals is a model or has been through a program that laid it in place.
        if i > 0 && !args.as_placed {
            if raw.normals.is_some() {
                bars.note(&format!(
                    "{}: it has normals, so it is taken to be in place and is not laid onto the scans \
                     before it",
                    path.display()
                ));
            } else {
                pose = views::lay(&joined, &mut placed, path, bars)? * pose;
            }
        }
        joined.join(placed);
        poses.push(pose);
    }
    Ok(Placed { scan: joined, poses, seed: None })
}

/// The one placement of files that share a frame.
fn together(
    args: &PlacedArgs,
    files: &[(&PathBuf, RawScan)],
    seed: u64,
    gravity: Gravity,
    bars: &Bars,
) -> anyhow::Result<Placement> {
    let Some((path, first)) = files.first() else { return upright(args, None) };
    let placement = match gravity {
        Gravity::Found if args.sensor_height.is_none() => leveled(args, first, seed, bars)?,
        _ => {
            let stated = first.warnings.iter().find_map(|warning| match warning {
                ScanWarning::Upright { up, .. } => UnitVector3::try_new(Vector3::from(*up), 1e-6),
                _ => None,
            });
            if args.up.is_none() && stated.is_none() {
                bars.note("up is taken to be 0,0,1 in the file's frame: --up says what it is");
            }
            upright(args, stated)?
        }
    };
    // What is lowest of all files rests on the support.
    let whole = match placement {
        Placement::Up { .. } if files.len() > 1 => {
            let all = |of: fn(&RawScan) -> &[Point3<f64>]| {
                files.iter().flat_map(|(_, raw)| of(raw).iter().copied()).collect()
            };
            let (points, vertices) = (all(|raw| &raw.points), all(RawScan::anchors));
            &RawScan { points, vertices, normals: None, ..first.clone() }
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
fn up(args: &PlacedArgs) -> anyhow::Result<Option<UnitVector3<f64>>> {
    let unit = |Numbers(v): Numbers<3>| {
        UnitVector3::try_new(Vector3::from(v), 1e-6).context("--up must not be the zero vector")
    };
    args.up.map(unit).transpose()
}

/// The placement by the largest level plane of a scan.
fn leveled(args: &PlacedArgs, raw: &RawScan, seed: u64, bars: &Bars) -> anyhow::Result<Placement> {
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

/// Up as it is asked for, else as the file states it, else z.
fn upright(args: &PlacedArgs, stated: Option<UnitVector3<f64>>) -> anyhow::Result<Placement> {
    let up = up(args)?.or(stated).unwrap_or(Vector3::z_axis());
    Ok(match args.sensor_height {
        Some(sensor_height) => {
            Placement::UpAndHeight { up, sensor_height, support_height: args.support_height }
        }
        None => Placement::Up { up, support_height: args.support_height },
    })
}
