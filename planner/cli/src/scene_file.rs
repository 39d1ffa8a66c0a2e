//! Scene files: where scans stand, and what was found in them.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use nullsweep_surface::room::Room;
use nullsweep_surface::{PlacedScan, Placement, ReadOptions, scan};
use serde::{Deserialize, Serialize};

use crate::floor::{Placed, Source};
use crate::numbers::isometry;
use crate::room::name;

/// A scene file: all in the floor frame, in metres.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    /// By which planes and objects were found, and points laid on meshes.
    seed: u64,
    /// What of it is to be swept, kept out of, avoided: a file of regions, from the scene file's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    regions: Option<PathBuf>,
    scan: Vec<ScanEntry>,
    #[serde(default)]
    plane: Vec<PlaneEntry>,
    #[serde(default)]
    object: Vec<ObjectEntry>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScanEntry {
    /// From the scene file's folder.
    file: PathBuf,
    points: usize,
    /// Factor from the file's unit to metres.
    scale: f64,
    /// Takes the file's coordinates to the floor frame: x, y, z, qx, qy, qz, qw.
    pose: [f64; 7],
    /// Where its sensor stood, if that is known.
    sensor: Option<[f64; 3]>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaneEntry {
    number: usize,
    kind: String,
    point: [f64; 3],
    normal: [f64; 3],
    area: f64,
    outline: Vec<[f64; 3]>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectEntry {
    number: usize,
    points: usize,
    min: [f64; 3],
    max: [f64; 3],
    centre: [f64; 3],
    stands_on: usize,
}

impl SceneFile {
    /// The file of a room, to be written at `path`.
    pub(super) fn of(path: &Path, placed: &Placed, room: &Room, seed: u64) -> anyhow::Result<Self> {
        let folder = std::path::absolute(path)?;
        let beside = |file: &Path| -> anyhow::Result<PathBuf> {
            let file = std::path::absolute(file)?;
            let near = folder.parent().and_then(|folder| file.strip_prefix(folder).ok());
            Ok(near.map_or_else(|| file.clone(), Path::to_path_buf))
        };
        let regions = placed.regions.as_deref().map(beside).transpose()?;
        let mut scan = Vec::with_capacity(placed.sources.len());
        for (Source { file, scale, pose }, view) in placed.sources.iter().zip(&placed.scan.views) {
            let (t, r) = (pose.translation.vector, pose.rotation.coords);
            scan.push(ScanEntry {
                file: beside(file)?,
                points: view.points.len(),
                scale: *scale,
                pose: [t.x, t.y, t.z, r.x, r.y, r.z, r.w],
                sensor: view.sensor.map(Into::into),
            });
        }
        let plane = room.planes.iter().enumerate().map(|(i, plane)| PlaneEntry {
            number: i + 1,
            kind: name(plane.kind).to_owned(),
            point: plane.point.into(),
            normal: plane.normal.into_inner().into(),
            area: plane.area,
            outline: plane.outline.iter().map(|p| (*p).into()).collect(),
        });
        let object = room.segments.iter().enumerate().map(|(i, segment)| ObjectEntry {
            number: i + 1,
            points: segment.points,
            min: segment.bounds.min.into(),
            max: segment.bounds.max.into(),
            centre: segment.centre.into(),
            stands_on: segment.stands_on + 1,
        });
        Ok(Self { seed, regions, scan, plane: plane.collect(), object: object.collect() })
    }

    pub(super) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let text = toml::to_string(self)?;
        std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
    }

    /// The scans of a scene file where they stand.
    pub(super) fn read(path: &Path) -> anyhow::Result<Placed> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let file: Self = toml::from_str(&text).with_context(|| {
            format!(
                "{}: not a scene file: `planner scene SCAN… --out FILE` writes one",
                path.display()
            )
        })?;
        ensure!(!file.scan.is_empty(), "{}: a scene without scans", path.display());
        let folder = path.parent().unwrap_or(Path::new(""));
        let (mut joined, mut sources) = (PlacedScan::default(), Vec::new());
        for entry in &file.scan {
            let name = folder.join(&entry.file);
            let options =
                ReadOptions { scale: entry.scale, seed: file.seed, ..ReadOptions::default() };
            let raw = scan::read(&name, &options)?;
            ensure!(
                raw.points.len() == entry.points,
                "{} has {} points, {} when {} was written: run `planner scene` again",
                name.display(),
                raw.points.len(),
                entry.points,
                path.display()
            );
            let pose = isometry(&entry.pose)
                .with_context(|| format!("{}: pose of {}", path.display(), name.display()))?;
            let placement = Placement::Frame { pose, sensor: entry.sensor.map(Into::into) };
            joined.join(scan::place(&raw, &placement).0);
            sources.push(Source { file: name, scale: entry.scale, pose });
        }
        let regions = file.regions.map(|regions| folder.join(regions));
        Ok(Placed { scan: joined, sources, regions, seed: Some(file.seed) })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::bars::Bars;
    use crate::placed::{Gravity, PlacedArgs, read_scans};

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        placed: PlacedArgs,
    }

    #[test]
    fn a_scene_file_gives_the_scans_as_they_were_and_says_where_one_was_changed() {
        let folder = tempfile::tempdir().expect("a folder");
        let scan = folder.path().join("floor.xyz");
        let row = |i: usize| format!("{} {} {}\n", 10 * (i % 60), 10 * (i / 60), 1000 + i % 3);
        let rows: String = (0..3600).map(row).collect();
        std::fs::write(&scan, &rows).expect("written");
        let line = ["x", "--up=0,0.1,1", "--sensor-height", "0.9", "--scale", "0.001"];
        let args = Line::parse_from(line).placed;
        let bars = Bars::new();
        let scans = [scan.clone()];
        let found = read_scans(&args, &scans, 1, Gravity::Given, &bars).expect("a scan");
        let path = folder.path().join("scene.toml");
        let room = Room::find(&found.scan, 1);
        let file = SceneFile::of(&path, &found, &room, 7).expect("a file");
        assert_eq!(file.scan[0].file, Path::new("floor.xyz"), "from the file's folder on");
        file.write(&path).expect("written");

        let plain = Line::parse_from(["x"]).placed;
        let files = [path.clone()];
        let again = read_scans(&plain, &files, 1, Gravity::Found, &bars).expect("the same");
        let (one, other) = (&found.scan.views[0], &again.scan.views[0]);
        assert_eq!((one.sensor, one.points.len()), (other.sensor, other.points.len()));
        let apart = |(a, b)| nalgebra::distance::<f64, 3>(a, b);
        assert!(one.points.iter().zip(&other.points).map(apart).all(|d| d < 1e-12));
        assert_eq!(again.seed, Some(7));
        // A scene made of a scene is the same, also elsewhere.
        let below = folder.path().join("below");
        std::fs::create_dir(&below).expect("a folder");
        let copy = below.join("copy.toml");
        SceneFile::of(&copy, &again, &room, 7).expect("a file").write(&copy).expect("written");
        let copied = read_scans(&plain, &[copy], 1, Gravity::Found, &bars).expect("the same");
        assert_eq!(copied.scan.views[0].points, again.scan.views[0].points);

        // What a cell says of scans does not turn a scene.
        let turned = read_scans(&args, &files, 1, Gravity::Found, &bars).expect("the same");
        assert_eq!(turned.scan.views[0].points, again.scan.views[0].points);
        std::fs::write(&scan, rows + "0 0 1000\n").expect("written");
        let error = read_scans(&plain, &files, 1, Gravity::Found, &bars).err().expect("changed");
        assert!(error.to_string().contains("3601 points, 3600 when"), "{error}");
    }
}
