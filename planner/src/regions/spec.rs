//! Files of regions, and what they are of a scan.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use nullsweep_surface::PlacedScan;
use nullsweep_surface::room::Room;
use serde::Deserialize;

use super::error::RegionError;
use super::marked::Marked;
use super::region::{Kind, Region, Regions, Sweep};
use super::volume::{Shape, Volume, area};

/// A file of regions. \[m\], \[rad\]
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// In which frame its regions are that do not say it.
    #[serde(default)]
    frame: Frame,
    #[serde(default)]
    region: Vec<Entry>,
}

/// What regions are found in.
#[derive(Clone, Copy, Debug)]
pub struct Around<'a> {
    /// What was scanned, in the floor frame.
    pub scan: &'a PlacedScan,
    /// What takes the first scan file's coordinates there.
    pub scan_to_floor: Isometry3<f64>,
    /// By which objects are found.
    pub seed: u64,
}

/// Passes that may be asked for.
const PASSES: std::ops::RangeInclusive<u32> = 1..=20;

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Frame {
    /// The floor frame.
    #[default]
    Scene,
    /// The first scan file's own.
    Scan,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Option<String>,
    kind: What,
    frame: Option<Frame>,
    passes: Option<u32>,
    tool_speed: Option<f64>,
    priority: Option<i32>,
    #[serde(rename = "box")]
    cuboid: Option<Cuboid>,
    sphere: Option<Sphere>,
    prism: Option<Prism>,
    half_space: Option<HalfSpace>,
    object: Option<usize>,
    colour: Option<Colour>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum What {
    Sweep,
    KeepOut,
    Avoid,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Cuboid {
    centre: [f64; 3],
    size: [f64; 3],
    #[serde(default)]
    rpy: [f64; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sphere {
    centre: [f64; 3],
    radius: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Prism {
    outline: Vec<[f64; 2]>,
    /// From which to which z of its frame.
    z: [f64; 2],
    #[serde(default)]
    origin: [f64; 3],
    #[serde(default)]
    rpy: [f64; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HalfSpace {
    point: [f64; 3],
    /// Points into it.
    normal: [f64; 3],
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Colour {
    /// 0 … 255 each.
    rgb: [u8; 3],
    /// Farthest that a point's colour is from it, by the distance of red, green and blue.
    within: f64,
}

impl Spec {
    /// Reads a file.
    ///
    /// # Errors
    /// [`RegionError::File`] or [`RegionError::Parse`].
    pub fn read(path: &Path) -> Result<Self, RegionError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| RegionError::File { path: path.into(), source })?;
        Self::parse(&text, path)
    }

    /// Reads the text of a file; `path` is only used to name it.
    ///
    /// # Errors
    /// [`RegionError::Parse`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, RegionError> {
        let wrong = |cause: String| RegionError::Parse { path: path.into(), cause };
        let spec: Self = toml::from_str(text).map_err(|error| wrong(error.to_string()))?;
        if spec.region.is_empty() {
            return Err(wrong("no [[region]] in it".into()));
        }
        Ok(spec)
    }

    /// The regions, in the floor frame.
    ///
    /// # Errors
    /// [`RegionError::Region`].
    pub fn find(&self, around: &Around<'_>) -> Result<Regions, RegionError> {
        let mut room = None;
        let mut all = Vec::with_capacity(self.region.len());
        for (k, entry) in self.region.iter().enumerate() {
            let name = entry.name.clone().unwrap_or_else(|| format!("{}", k + 1));
            let region = entry
                .find(&name, self.frame, around, &mut room)
                .map_err(|what| RegionError::Region { region: name, what })?;
            all.push(region);
        }
        Ok(Regions::new(all))
    }
}

impl Entry {
    fn find(
        &self,
        name: &str,
        frame: Frame,
        around: &Around<'_>,
        room: &mut Option<Room>,
    ) -> Result<Region, String> {
        let to_floor = match self.frame.unwrap_or(frame) {
            Frame::Scene => Isometry3::identity(),
            Frame::Scan => around.scan_to_floor,
        };
        let shapes = self.shapes()?;
        let mut volumes: Vec<Volume> = shapes.iter().map(|v| v.transformed(&to_floor)).collect();
        let marked = |shape: Marked| Volume {
            shape: Shape::Marked(Arc::new(shape)),
            pose: Isometry3::identity(),
        };
        if let Some(number) = self.object {
            let room = room.get_or_insert_with(|| Room::find(around.scan, around.seed));
            volumes.push(marked(object(around.scan, room, number)?));
        }
        if let Some(colour) = &self.colour {
            volumes.push(marked(colour.find(around.scan)?));
        }
        if volumes.is_empty() {
            return Err(
                "it has no shape: box, sphere, prism, half_space, object or colour is wanted"
                    .into(),
            );
        }
        let kind = self.kind()?;
        if kind == Kind::Avoid && (volumes.len() > 1 || shapes.is_empty()) {
            return Err(
                "what is to be avoided is one box, sphere, prism or half_space: what was measured is in \
                 the way by itself"
                    .into(),
            );
        }
        Ok(Region { name: name.to_owned(), kind, volumes })
    }

    fn kind(&self) -> Result<Kind, String> {
        let said = self.passes.is_some() || self.tool_speed.is_some() || self.priority.is_some();
        match self.kind {
            What::KeepOut | What::Avoid if said => {
                Err("passes, tool_speed and priority are of regions to sweep".into())
            }
            What::KeepOut => Ok(Kind::KeepOut),
            What::Avoid => Ok(Kind::Avoid),
            What::Sweep => {
                let passes = self.passes.unwrap_or(1);
                if !PASSES.contains(&passes) {
                    let (least, most) = (PASSES.start(), PASSES.end());
                    return Err(format!("passes is {passes}: {least} to {most} is wanted"));
                }
                if let Some(speed) = self.tool_speed.filter(|v| !(v.is_finite() && *v > 0.0)) {
                    return Err(format!("tool_speed is {speed} m/s: a number above 0 is wanted"));
                }
                let (tool_speed, priority) = (self.tool_speed, self.priority.unwrap_or(0));
                Ok(Kind::Sweep(Sweep { passes, tool_speed, priority }))
            }
        }
    }

    /// Its volumes in its frame.
    fn shapes(&self) -> Result<Vec<Volume>, String> {
        let mut volumes = Vec::new();
        if let Some(Cuboid { centre, size, rpy }) = &self.cuboid {
            above_0("box: size", size)?;
            let shape = Shape::Box { half: Vector3::from(*size) * 0.5 };
            volumes.push(Volume { shape, pose: pose("box", *centre, *rpy)? });
        }
        if let Some(Sphere { centre, radius }) = &self.sphere {
            above_0("sphere: radius", &[*radius])?;
            let shape = Shape::Sphere { radius: *radius };
            volumes.push(Volume { shape, pose: pose("sphere", *centre, [0.0; 3])? });
        }
        if let Some(Prism { outline, z: [low, high], origin, rpy }) = &self.prism {
            let finite = outline.iter().flatten().chain([low, high]).all(|v| v.is_finite());
            // What covers less than a square millimetre is none.
            if outline.len() < 3 || !finite || low >= high || area(outline) < 1e-6 {
                return Err(
                    "prism: an outline of three corners or more about some area, and z = [from, to] are \
                     wanted"
                        .into(),
                );
            }
            let shape = Shape::Prism { outline: outline.clone(), low: *low, high: *high };
            volumes.push(Volume { shape, pose: pose("prism", *origin, *rpy)? });
        }
        if let Some(HalfSpace { point, normal }) = &self.half_space {
            let normal = UnitVector3::try_new(Vector3::from(*normal), 1e-9)
                .filter(|n| n.iter().all(|v| v.is_finite()))
                .ok_or("half_space: its normal must not be zero")?;
            let turn =
                UnitQuaternion::rotation_between(&Vector3::z(), &normal).unwrap_or_else(|| {
                    UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
                });
            let at = pose("half_space", *point, [0.0; 3])?;
            volumes.push(Volume { shape: Shape::HalfSpace, pose: at * turn });
        }
        Ok(volumes)
    }
}

/// The points of the views, in their order.
fn points(scan: &PlacedScan) -> Vec<Point3<f64>> {
    scan.views.iter().flat_map(|view| view.points.iter().copied()).collect()
}

/// The points of an object of the scene, by its number from 1 on.
fn object(scan: &PlacedScan, room: &Room, number: usize) -> Result<Marked, String> {
    let count = room.segments.len();
    let Some(segment) = number.checked_sub(1).and_then(|index| room.segments.get(index)) else {
        return Err(format!(
            "there is no object {number}: the scene has {count}, numbered from 1 on"
        ));
    };
    let mut marked = Vec::new();
    for (view, members) in scan.views.iter().zip(&segment.members) {
        let first = marked.len();
        marked.resize(first + view.points.len(), false);
        members.iter().for_each(|&member| marked[first + member as usize] = true);
    }
    Ok(Marked::new(points(scan), marked))
}

impl Colour {
    /// The points that are painted so.
    fn find(&self, scan: &PlacedScan) -> Result<Marked, String> {
        if !(self.within.is_finite() && self.within >= 0.0) {
            return Err(format!(
                "colour: within is {}: a number of at least 0 is wanted",
                self.within
            ));
        }
        let (mut at, mut apart) = (Vec::new(), Vec::new());
        for view in &scan.views {
            let Some(colours) = &view.colours else { continue };
            at.extend(view.points.iter().copied());
            apart.extend(colours.iter().map(|colour| self.distance(*colour)));
        }
        let nearest = scan
            .views
            .iter()
            .filter_map(|view| view.colours.as_ref())
            .flatten()
            .min_by(|a, b| self.distance(**a).total_cmp(&self.distance(**b)));
        match nearest {
            None => Err("no scan has colours: PCD, PLY and tables with columns r, g, b do".into()),
            Some(rgb) if self.distance(*rgb) > self.within => Err(format!(
                "no point has the colour {:?}, give or take {}: the nearest colour is {rgb:?}, {:.0} away",
                self.rgb,
                self.within,
                self.distance(*rgb)
            )),
            Some(_) => {
                let marked = apart.iter().map(|apart| *apart <= self.within).collect();
                Ok(Marked::new(at, marked))
            }
        }
    }

    fn distance(&self, other: [u8; 3]) -> f64 {
        let squares =
            self.rgb.iter().zip(other).map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2));
        squares.sum::<f64>().sqrt()
    }
}

fn above_0(what: &str, sizes: &[f64]) -> Result<(), String> {
    match sizes.iter().find(|size| !(size.is_finite() && **size > 0.0)) {
        Some(size) => Err(format!("{what} is {size} m: above 0 is wanted")),
        None => Ok(()),
    }
}

fn pose(what: &str, at: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Result<Isometry3<f64>, String> {
    if !at.iter().chain(&[roll, pitch, yaw]).all(|v| v.is_finite()) {
        return Err(format!("{what}: its place is not finite"));
    }
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Ok(Isometry3::from_parts(Translation3::from(at), rotation))
}

#[cfg(test)]
mod tests;
