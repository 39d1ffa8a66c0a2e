//! Scan files in the floor frame, joined.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use nullsweep_planner::progress::Progress;
use nullsweep_surface::room;
use nullsweep_surface::scan::ScanWarning;
use nullsweep_surface::{PlacedScan, Placement, RawScan, ReadOptions, scan};

use crate::advice;
use crate::bars::Bars;
use crate::exit::Usage;
use crate::floor::{Placed, Source};
use crate::numbers::{Numbers, finite, isometry, not_negative, positive};
use crate::scene_file::SceneFile;
use crate::views;

/// How the scans stand.
#[derive(Clone, Debug, Args)]
pub(super) struct PlacedArgs {
    /// Pose of a scan's sensor in the floor frame: x,y,z,qx,qy,qz,qw; once for each scan. Of a file
    /// whose sensor is not its origin (a mesh, PTX or E57), the pose of its frame.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    sensor_pose: Vec<Numbers<7>>,
    /// Direction against gravity in the scans' frame: x,y,z.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with = "sensor_pose")]
    up: Option<Numbers<3>>,
    /// Take several scans as they are placed, without laying each onto those before it.
    #[arg(long)]
    pub(super) as_placed: bool,
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
        ensure!(
            args.sensor_pose.is_empty(),
            Usage(format!(
                "{}: a scene file says how its scans stand: leave out --sensor-pose",
                path.display()
            ))
        );
        // A cell file may say it of all other scans.
        if args.up.is_some() || args.scale != 1.0 {
            bars.note(&format!(
                "{} says how its scans stand: --up and --scale are not heeded",
                path.display()
            ));
        }
        return SceneFile::read(path);
    }
    ensure!(
        args.sensor_pose.is_empty() || args.sensor_pose.len() == scans.len(),
        Usage(format!(
            "--sensor-pose is there {} times for {} scans: one for each, in their order",
            args.sensor_pose.len(),
            scans.len()
        ))
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
    let (mut joined, mut sources) = (PlacedScan::default(), Vec::with_capacity(files.len()));
    for (i, (path, raw)) in files.into_iter().enumerate() {
        let placement = match shared {
            Some((pose, is_seen)) => {
                let sensor = raw.sensor.filter(|_| is_seen).map(|at| pose * at);
                Placement::Frame { pose, sensor }
            }
            None => {
                if raw.sensor.is_none() {
                    note_unseen(path, "the pose is", bars);
                }
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
        sources.push(Source { file: path.clone(), scale: args.scale, pose });
    }
    Ok(Placed { scan: joined, sources, regions: None, seed: None })
}

/// Tells that a file does not say where its sensor stood, though an argument speaks of it.
fn note_unseen(path: &Path, what: &str, bars: &Bars) {
    bars.note(&format!(
        "{}: where its sensor stood is not known (a mesh, a flown lidar, several scans in one): {what} \
         that of the file's frame, and nothing behind its points counts as unseen",
        path.display()
    ));
}

/// The one pose of files that share a frame, and whether their sensors are to be believed.
fn together(
    args: &PlacedArgs,
    files: &[(&PathBuf, RawScan)],
    seed: u64,
    gravity: Gravity,
    bars: &Bars,
) -> anyhow::Result<(Isometry3<f64>, bool)> {
    let Some((path, first)) = files.first() else { return Ok((Isometry3::identity(), false)) };
    let (placement, is_seen) = match gravity {
        Gravity::Found if args.sensor_height.is_none() => leveled(args, first, seed, bars)?,
        _ => {
            let stated = first.warnings.iter().find_map(|warning| match warning {
                ScanWarning::Upright { up, .. } => UnitVector3::try_new(Vector3::from(*up), 1e-6),
                _ => None,
            });
            if args.up.is_none() && stated.is_none() {
                bars.note("up is taken to be 0,0,1 in the file's frame: --up says what it is");
                if let Some(up) = room::held(first) {
                    bars.note(&format!(
                        "{}: all of it lies before its origin, as a depth camera there sees it: if one \
                         did, the scan now lies on its back, and --up {},{},{} is right for a camera \
                         held level (--object finds gravity by itself, where a floor or a table is \
                         seen)",
                        path.display(),
                        up.x, up.y, up.z
                    ));
                }
            }
            if args.sensor_height.is_some() && first.sensor.is_none() {
                note_unseen(path, "--sensor-height is", bars);
            }
            let placement = upright(args, stated)?;
            if let Placement::Up { up, .. } | Placement::UpAndHeight { up, .. } = &placement {
                doubt(path, first, up, seed, bars);
            }
            (placement, args.sensor_height.is_some())
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
    let placed = scan::place(whole, &placement).1;
    if let Placement::Up { up, support_height } = &placement {
        // Only where the file says nothing else of it.
        let height = (placed * Point3::origin()).z - support_height;
        let [x, y, z] = up.into_inner().into();
        bars.note(&format!(
            "the scan's lowest points are taken to stand on the floor, or on its support: the file's \
             origin is then {height:.3} m above it along {x:.4},{y:.4},{z:.4} (--sensor-height says it)"
        ));
    }
    let below = scan::below_support(whole, &placement);
    if below > 0 {
        let path = path.display();
        bars.note(&format!("{path}: {below} points alone below all others: nothing rests on them"));
    }
    Ok((placed, is_seen))
}

/// Tells where a scan shows large planes, and none that is level by what is taken to be up.
fn doubt(path: &Path, scan: &RawScan, up: &UnitVector3<f64>, seed: u64, bars: &Bars) {
    let Some(lean) = room::lean(scan, up, seed) else { return };
    let told = |up: &UnitVector3<f64>| format!("{:.4},{:.4},{:.4}", up.x, up.y, up.z);
    bars.note(&format!(
        "{}: by up {} no plane in it is level; the nearest to it, {:.2} m² of it seen, leans by {:.0}\u{b0}: if \
         things stand on it, say --up {}",
        path.display(),
        told(up),
        lean.area,
        lean.angle.to_degrees(),
        told(&lean.up)
    ));
}

/// The direction that `--up` gives.
fn up(args: &PlacedArgs) -> anyhow::Result<Option<UnitVector3<f64>>> {
    let unit = |Numbers(v): Numbers<3>| {
        UnitVector3::try_new(Vector3::from(v), 1e-6).context("--up must not be the zero vector")
    };
    args.up.map(unit).transpose()
}

/// The placement by the largest level plane of a scan, and whether its sensor is known.
fn leveled(
    args: &PlacedArgs,
    raw: &RawScan,
    seed: u64,
    bars: &Bars,
) -> anyhow::Result<(Placement, bool)> {
    let level = room::level(raw, up(args)?, seed)?;
    let [x, y, z] = level.up.into_inner().into();
    bars.note(&format!(
        "up is {x:.4},{y:.4},{z:.4} and the file's origin {:.3} m above what things stand on, by a \
         level plane of which {:.2} m² are seen",
        level.height, level.area
    ));
    let support_height = args.support_height;
    let at = raw.sensor.unwrap_or_default();
    let sensor_height = level.height + level.up.dot(&at.coords);
    let placement = Placement::UpAndHeight { up: level.up, sensor_height, support_height };
    let is_seen = level.camera || raw.sensor.is_some() && at != Point3::origin();
    if !is_seen {
        bars.note(
            "the file's origin is no camera: which side of a surface is outside is voted for",
        );
    }
    Ok((placement, is_seen))
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        placed: PlacedArgs,
    }

    #[test]
    fn each_file_has_its_own_sensor_or_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let ptx = |name: &str, at: &str| {
            let axes = "1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n";
            let row = |i: usize| format!("0.{:02} 0.{:02} -2 0.5\n", i % 20, i / 20);
            let rows: String = (0..400).map(row).collect();
            let path = folder.path().join(name);
            let text = format!("20\n20\n{at}\n{axes}{at} 1\n{rows}");
            std::fs::write(&path, text).expect("written");
            path
        };
        let (one, other) = (ptx("one.ptx", "5 6 7"), ptx("other.ptx", "5 6.1 7"));
        let mesh = folder.path().join("mesh.obj");
        std::fs::write(&mesh, "v 5 6 5\nv 5.2 6 5\nv 5.2 6.2 5\nf 1 2 3\n").expect("written");
        let scans = [one, other, mesh];
        let bars = Bars::new();
        let sensors = |line: &[&str]| {
            let args = Line::parse_from(line).placed;
            let found = read_scans(&args, &scans, 1, Gravity::Given, &bars).expect("scans");
            let back = |(view, source): (&scan::View, &Source)| {
                view.sensor.map(|at| source.pose.inverse() * at)
            };
            found.scan.views.iter().zip(&found.sources).map(back).collect::<Vec<_>>()
        };
        let is_at = |found: Option<Point3<f64>>, y: f64| {
            found.is_some_and(|at| (at - Point3::new(5.0, y, 7.0)).norm() < 1e-9)
        };
        let high = ["x", "--as-placed", "--up=0,0,1", "--sensor-height", "2"];
        let pose = "--sensor-pose=0,0,0,0,0,0,1";
        for line in [&high[..], &["x", "--as-placed", pose, pose, pose]] {
            let found = sensors(line);
            assert!(is_at(found[0], 6.0) && is_at(found[1], 6.1), "{found:?}");
            assert_eq!(found[2], None);
        }
        assert_eq!(sensors(&["x", "--as-placed", "--up=0,0,1"]), [None; 3]);
    }
}
