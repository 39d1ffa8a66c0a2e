//! `planner scene`.

use std::path::PathBuf;

use clap::Args;
use nalgebra::Point3;
use nullsweep_planner::progress::Progress;
use nullsweep_report::{self as report, Cloud, LineSet, Paint, Place, PlaceGroup, ReportData};
use nullsweep_surface::PlacedScan;
use nullsweep_surface::room::Room;

use crate::bars::Bars;
use crate::exit::OK;
use crate::output::{say, writable};
use crate::placed::{Gravity, PlacedArgs, read_scans};
use crate::room::{SEED, name, without_objects};
use crate::scene_file::SceneFile;
use crate::sheet::sheet;

#[derive(Debug, Args)]
pub(super) struct SceneCommandArgs {
    /// Scan files: PCD, PLY, XYZ/CSV, STL, OBJ, glTF/GLB, LAS/LAZ, E57, PTX or NPY.
    #[arg(required = true)]
    scans: Vec<PathBuf>,
    #[command(flatten)]
    placed: PlacedArgs,
    /// Seed of every random choice: the same seed finds the same planes and objects. A scene file has
    /// its own.
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Write where the scans stand, planes and objects as TOML to a file, which `planner plan` and
    /// `planner verify` take in place of the scans.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a page with a picture of planes and objects.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

pub(super) fn run(args: &SceneCommandArgs) -> anyhow::Result<u8> {
    let bars = Bars::new();
    for out in args.out.iter().chain(&args.report) {
        writable(out)?;
    }
    bars.stage("scan", None);
    let found = read_scans(&args.placed, &args.scans, args.seed, Gravity::Found, &bars)?;
    let scan = &found.scan;
    bars.stage("planes and objects", None);
    // The numbers are those by which `plan --object` takes a scene file's.
    let seed = found.seed.unwrap_or(args.seed);
    let room = Room::find(scan, seed);
    bars.clear();
    let mut table = sheet(COLUMNS);
    table.add_rows(rows(&room));
    match without_objects(&room) {
        Some(why) if room.planes.is_empty() => say!("{why}"),
        Some(why) => say!("{table}\n{why}"),
        None => say!("{table}"),
    }
    if let Some(path) = &args.out {
        SceneFile::of(path, &found, &room, seed)?.write(path)?;
        say!("scene: {}", path.display());
    }
    if let Some(path) = &args.report {
        report::write(path, &picture(&args.scans, scan, &room))?;
        say!("report: {}", path.display());
    }
    Ok(OK)
}

const COLUMNS: [&str; 5] = ["", "points or m\u{b2}", "from [m]", "to [m]", "stands on"];

/// Planes, then objects, for people.
fn rows(room: &Room) -> Vec<Vec<String>> {
    let corner = |p: &Point3<f64>| format!("{:.2}, {:.2}, {:.2}", p.x, p.y, p.z);
    let planes = room.planes.iter().enumerate().map(|(i, plane)| {
        let first = plane.outline.first().copied().unwrap_or(plane.point);
        let (low, high) =
            plane.outline.iter().fold((first, first), |(l, h), p| (l.inf(p), h.sup(p)));
        vec![
            format!("plane {}: {}", i + 1, name(plane.kind)),
            format!("{:.2} m\u{b2}", plane.area),
            corner(&low),
            corner(&high),
            String::new(),
        ]
    });
    let objects = room.segments.iter().enumerate().map(|(i, segment)| {
        vec![
            format!("object {}", i + 1),
            segment.points.to_string(),
            corner(&segment.bounds.min),
            corner(&segment.bounds.max),
            format!("plane {}", segment.stands_on + 1),
        ]
    });
    planes.chain(objects).collect()
}

/// The page of a room: its planes and objects by number.
pub(super) fn picture(scans: &[PathBuf], scan: &PlacedScan, room: &Room) -> ReportData {
    let mut taken: Vec<Vec<bool>> =
        scan.views.iter().map(|view| vec![false; view.points.len()]).collect();
    let mut clouds = Vec::new();
    let mut objects = Vec::new();
    for (i, segment) in room.segments.iter().enumerate() {
        let mut points = Vec::with_capacity(segment.points);
        for (v, members) in segment.members.iter().enumerate() {
            for &member in members {
                points.push(scan.views[v].points[member as usize]);
                taken[v][member as usize] = true;
            }
        }
        let name = format!("object {}", i + 1);
        objects.push(Place {
            label: format!("{name}: {} points", segment.points),
            at: segment.centre,
            radius: 0.5 * (segment.bounds.max - segment.bounds.min).norm(),
            normal: None,
        });
        clouds.push(Cloud { name, paint: Paint::Numbered(i), points, shown: true });
    }
    let all = scan.views.iter().zip(&taken).flat_map(|(view, taken)| view.points.iter().zip(taken));
    let points = all.filter(|(_, taken)| !**taken).map(|(point, _)| *point).collect();
    clouds.push(Cloud { name: "all else".into(), paint: Paint::Around, points, shown: true });
    let mut planes = Vec::new();
    let mut lines = Vec::new();
    for (i, plane) in room.planes.iter().enumerate() {
        let label = format!("plane {}: {}, {:.2} m\u{b2}", i + 1, name(plane.kind), plane.area);
        let radius = plane.outline.iter().map(|p| (p - plane.point).norm()).fold(0.0, f64::max);
        planes.push(Place { label, at: plane.point, radius, normal: None });
        lines.push(plane.outline.iter().chain(plane.outline.first()).copied().collect());
    }
    let files: Vec<String> = scans.iter().map(|path| path.display().to_string()).collect();
    let group =
        |name: &str, items| PlaceGroup { name: name.into(), items, ..PlaceGroup::default() };
    ReportData {
        title: "Nullsweep scene".into(),
        subtitle: files.join(", "),
        places: vec![group("Objects", objects), group("Planes", planes)],
        tables: vec![report::Table {
            title: "Planes and objects".into(),
            columns: COLUMNS.map(Into::into).into(),
            rows: rows(room),
        }],
        clouds,
        lines: vec![LineSet { name: "outlines of planes".into(), lines, shown: true }],
        ..ReportData::default()
    }
}
