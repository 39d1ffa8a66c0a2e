//! The scan that a command works on, from files or simulated, in the floor frame.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_collision::Obstacle;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::Geometry;
use nullsweep_surface::{
    CleanConfig, CropBox, PlacedScan, Placement, ReadOptions, Scan, scan, simulate,
};

use crate::advice;
use crate::bars::Bars;
use crate::numbers::{Numbers, finite, not_negative, positive};

/// How the scans stand and what of them is swept.
#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Pose of a scan's sensor in the floor frame: x,y,z,qx,qy,qz,qw; once for each scan.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    sensor_pose: Vec<Numbers<7>>,
    /// Direction against gravity in the scans' frame: x,y,z.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with = "sensor_pose")]
    up: Option<Numbers<3>>,
    /// Height of the sensor above what the object stands on. [m]
    #[arg(long, value_name = "M", requires = "up", value_parser = finite)]
    sensor_height: Option<f64>,
    /// Height above the floor of what the object stands on; above 0 it becomes a table. [m]
    #[arg(long, value_name = "M", default_value_t = 0.0, value_parser = not_negative)]
    support_height: f64,
    /// Factor from the file's unit to metres: 0.001 for millimetres.
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    scale: f64,
    /// Keep only this box of the floor frame as the surface to sweep, the rest stays an obstacle:
    /// xmin,ymin,zmin,xmax,ymax,zmax.
    #[arg(long, value_name = "BOX", allow_hyphen_values = true)]
    crop: Option<CropBox>,
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

/// Reads and joins the scans, or simulates `demo`'s with the noise of `seed`, and cleans them.
pub(super) fn scene(
    args: &SceneArgs,
    demo: Option<Demo>,
    scans: &[PathBuf],
    seed: u64,
    bars: &Bars,
) -> anyhow::Result<Scene> {
    let (placed, region) = match demo {
        Some(demo) => simulated(demo, seed),
        None => (read_scans(args, scans, seed, bars)?, None),
    };
    let region = args.crop.or(region);
    let config = CleanConfig::default();
    let mut scene = match region {
        None => Scene::on_floor(scan::clean(&placed, &config)?.0),
        Some(region) => Scene::from(scan::clean_region(&placed, &region, &config)?),
    };
    if args.support_height > 0.0 {
        scene.obstacles.push(table_under(&scene.surface, args.support_height));
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

fn read_scans(
    args: &SceneArgs,
    scans: &[PathBuf],
    seed: u64,
    bars: &Bars,
) -> anyhow::Result<PlacedScan> {
    ensure!(
        args.sensor_pose.is_empty() || args.sensor_pose.len() == scans.len(),
        "{} scans but {} sensor poses: give one --sensor-pose for each scan, in their order",
        scans.len(),
        args.sensor_pose.len()
    );
    let options = ReadOptions { scale: args.scale, seed, ..ReadOptions::default() };
    let mut joined = PlacedScan::default();
    let mut shared: Option<Placement> = None;
    for (i, path) in scans.iter().enumerate() {
        let raw = scan::read(path, &options)?;
        for warning in &raw.warnings {
            let advice = advice::on_warning(warning).map(|advice| format!(" ({advice})"));
            bars.note(&format!("{}: {warning}{}", path.display(), advice.unwrap_or_default()));
        }
        let placement = match (args.sensor_pose.get(i), &shared) {
            (Some(pose), _) => Placement::SensorPose(isometry(pose)?),
            // Further scans without a pose of their own share the first one's frame.
            (None, Some(frame)) => frame.clone(),
            (None, None) => upright(args)?,
        };
        let (placed, pose) = scan::place(&raw, &placement);
        let sensor = placed.views[0].sensor;
        shared.get_or_insert(Placement::Frame { pose, sensor });
        joined.join(placed);
    }
    Ok(joined)
}

fn upright(args: &SceneArgs) -> anyhow::Result<Placement> {
    let up = match args.up {
        None => Vector3::z_axis(),
        Some(Numbers(v)) => UnitVector3::try_new(Vector3::from(v), 1e-6)
            .context("--up must not be the zero vector")?,
    };
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

/// How far a table top reaches beyond the object. [m]
const TABLE_RIM: f64 = 0.10;
/// Thickness of a table top. [m]
const TABLE_TOP: f64 = 0.03;

/// A table top under the scan.
fn table_under(scan: &Scan, height: f64) -> Obstacle {
    let mut low = Point3::new(f64::INFINITY, f64::INFINITY, height - TABLE_TOP);
    let mut high = Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, height);
    for p in &scan.points {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis] - TABLE_RIM);
            high[axis] = high[axis].max(p[axis] + TABLE_RIM);
        }
    }
    Obstacle {
        name: "table".into(),
        shape: Geometry::Box { half_extents: (high - low) * 0.5 }.into(),
        pose: Isometry3::from(nalgebra::center(&low, &high).coords),
        carries_robot: false,
    }
}
