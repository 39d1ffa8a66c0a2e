//! What a page shows.

use std::path::PathBuf;

use nalgebra::{Isometry3, Point3, UnitVector3};
use thiserror::Error;

/// Everything on the page. All points in one frame, z up. \[m\]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportData {
    /// Heading of the page.
    pub title: String,
    /// A line under it: input, robot, seed.
    pub subtitle: String,
    /// The figures that matter most, in order.
    pub headline: Vec<Headline>,
    /// What was guessed or taken for granted, each a sentence beside the figures.
    pub notes: Vec<String>,
    /// Tables of figures, in order.
    pub tables: Vec<Table>,
    /// What is left, or what there is: a list by group, each entry a place to fly to.
    pub places: Vec<PlaceGroup>,
    /// Points.
    pub clouds: Vec<Cloud>,
    /// Distance between neighbouring points of the clouds; 0: not known. \[m\]
    pub spacing: f64,
    /// Thin lines: a graph, outlines.
    pub lines: Vec<LineSet>,
    /// The robot's shapes, and what stands around it.
    pub shapes: Vec<Shape>,
    /// What moves with the arm's joints, parents first.
    pub bodies: Vec<Body>,
    /// Where the pad's centre is.
    pub pad: Option<PadCentre>,
    /// The joints, in the order of [`Motion::joints`].
    pub joints: Vec<JointAxis>,
    /// Planned motions by when they begin; each takes over from the one before.
    pub plans: Vec<Motion>,
    /// Measured motions.
    pub measured: Vec<Motion>,
}

/// One of the figures that matter most.
#[derive(Clone, Debug, PartialEq)]
pub struct Headline {
    /// What it is.
    pub label: String,
    /// The figure with its unit.
    pub value: String,
    /// What it means, or of what it is.
    pub detail: String,
    /// How it is to be taken.
    pub tone: Tone,
}

/// How a figure is to be taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// As it is.
    #[default]
    Plain,
    /// As it should be.
    Good,
    /// With care.
    Warn,
    /// As a fault.
    Bad,
}

/// A table; the first column of each row names it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Heading.
    pub title: String,
    /// Column headings; empty: none.
    pub columns: Vec<String>,
    /// Rows of cells.
    pub rows: Vec<Vec<String>>,
}

/// Places of one kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaceGroup {
    /// What they have in common: a cause.
    pub name: String,
    /// How much it is in all.
    pub detail: String,
    /// The places.
    pub items: Vec<Place>,
}

/// A place to fly to.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Its line in the list.
    pub label: String,
    /// Its middle. \[m\]
    pub at: Point3<f64>,
    /// Of a ball around it. \[m\]
    pub radius: f64,
    /// Which side it is seen from, where that matters.
    pub normal: Option<UnitVector3<f64>>,
}

/// In which colour points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    /// Swept.
    Swept,
    /// Left.
    Left,
    /// The border of what no view has seen.
    Unseen,
    /// What else was measured.
    Around,
    /// A colour of its own.
    Numbered(usize),
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// Name of the button that hides it.
    pub name: String,
    /// Its colour.
    pub paint: Paint,
    /// Where they are. \[m\]
    pub points: Vec<Point3<f64>>,
    /// Whether it is shown at first.
    pub shown: bool,
}

/// Lines of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct LineSet {
    /// Name of the button that hides them.
    pub name: String,
    /// Each line by its points. \[m\]
    pub lines: Vec<Vec<Point3<f64>>>,
    /// Whether they are shown at first.
    pub shown: bool,
}

/// What a shape is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// The robot's own.
    Robot,
    /// The tool's pad.
    Pad,
    /// Of the robot, but made up for a shape that is missing.
    Guessed,
    /// Something in the way.
    Obstacle,
    /// What the robot stands on.
    Ground,
}

/// A thing of triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Its link's name, or its own.
    pub name: String,
    /// What it is.
    pub look: Look,
    /// The body that carries it; `None`: it stands still.
    pub body: Option<usize>,
    /// Corners in the body's frame, or in the page's. \[m\]
    pub vertices: Vec<Point3<f64>>,
    /// Corners of each triangle, anticlockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// What one driven joint moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The body that it hangs on; `None`: the page's frame.
    pub parent: Option<usize>,
    /// The joint's frame in the parent's at value 0. \[m\]
    pub rest: Isometry3<f64>,
    /// The joint's axis in its frame.
    pub axis: UnitVector3<f64>,
    /// Slides along the axis instead of turning about it.
    pub slides: bool,
    /// Which of [`ReportData::joints`] drives it.
    pub joint: usize,
    /// The joint's value is `factor` times the position of that one, more `offset`.
    pub factor: f64,
    /// \[rad\] or \[m\]
    pub offset: f64,
}

/// Where the pad's centre is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PadCentre {
    /// The body that carries the pad.
    pub body: usize,
    /// In its frame. \[m\]
    pub centre: Point3<f64>,
}

/// One joint of the arm.
#[derive(Clone, Debug, PartialEq)]
pub struct JointAxis {
    /// Its URDF name.
    pub name: String,
    /// Of its position: rad or m.
    pub unit: &'static str,
    /// Soft limits; `None` for a continuous joint. \[rad\] or \[m\]
    pub limits: Option<(f64, f64)>,
}

/// A motion over time, planned or measured. All lists run parallel to `times`, or are empty where
/// it is not known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Name in the legends.
    pub name: String,
    /// When it begins on the page's clock. \[s\]
    pub starts_at: f64,
    /// Ascending, from its own start. \[s\]
    pub times: Vec<f64>,
    /// For each joint its positions. \[rad\] or \[m\]
    pub joints: Vec<Vec<f64>>,
    /// For each joint its velocities, of a motion that is cubic between its times; empty: straight.
    pub velocities: Vec<Vec<f64>>,
    /// Whether the pad is on the surface on the way to each time; empty: not known.
    pub contact: Vec<bool>,
    /// The knots, ascending, that the player jumps between: where a patch is reached.
    pub stops: Vec<u32>,
    /// Other quantities over time.
    pub series: Vec<Series>,
    /// Where the pad is at some times, also between knots: what the page's own kinematics is
    /// compared with when it opens.
    pub probes: Vec<Probe>,
}

/// A quantity over time; one called `press` can colour the path.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// What it is.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// Ascending, from the motion's start. \[s\]
    pub times: Vec<f64>,
    /// NaN: there is none.
    pub values: Vec<f64>,
    /// The value that stands for all beyond it.
    pub most: Option<f64>,
}

/// Where the pad's centre is at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// From the motion's start. \[s\]
    pub time: f64,
    /// \[m\]
    pub pad: Point3<f64>,
}

/// Why a report could not be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The file could not be written.
    #[error("{}: the report cannot be written", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Lists that must run parallel do not.
    #[error("report: {what} has {found} entries, {expected} are due")]
    Length {
        /// Which list.
        what: String,
        /// Its length.
        found: usize,
        /// The length of the list that it runs parallel to.
        expected: usize,
    },
    /// Something hangs on what is not there before it.
    #[error("report: {what} names number {index} of {known}")]
    Index {
        /// What hangs.
        what: String,
        /// On what.
        index: usize,
        /// How many there are.
        known: usize,
    },
}

impl ReportData {
    /// Checks that parallel lists are parallel, and that what hangs on something finds it.
    pub(super) fn check(&self) -> Result<(), ReportError> {
        let within = |what: String, index: usize, known: usize| {
            if index < known { Ok(()) } else { Err(ReportError::Index { what, index, known }) }
        };
        for (i, body) in self.bodies.iter().enumerate() {
            within(format!("joint of body {i}"), body.joint, self.joints.len())?;
            body.parent.map_or(Ok(()), |p| within(format!("parent of body {i}"), p, i))?;
        }
        for Shape { name, body, vertices, triangles, .. } in &self.shapes {
            body.map_or(Ok(()), |b| within(format!("body of {name}"), b, self.bodies.len()))?;
            let corner = triangles.iter().flatten().max().map(|c| *c as usize);
            corner.map_or(Ok(()), |c| within(format!("corner of {name}"), c, vertices.len()))?;
        }
        if let Some(pad) = &self.pad {
            within("body of the pad".into(), pad.body, self.bodies.len())?;
        }
        self.plans.iter().chain(&self.measured).try_for_each(|motion| motion.check(&self.joints))
    }
}

impl Motion {
    fn check(&self, axes: &[JointAxis]) -> Result<(), ReportError> {
        let same = |what: String, found: usize, expected: usize| {
            if found == expected {
                Ok(())
            } else {
                Err(ReportError::Length { what, found, expected })
            }
        };
        let Self { name, times, contact, .. } = self;
        same(format!("joints of {name}"), self.joints.len(), axes.len())?;
        if !contact.is_empty() {
            same(format!("contact of {name}"), contact.len(), times.len())?;
        }
        if !self.velocities.is_empty() {
            same(format!("velocities of {name}"), self.velocities.len(), axes.len())?;
        }
        for (joint, list) in axes.iter().zip(&self.joints).chain(axes.iter().zip(&self.velocities))
        {
            same(format!("{} of {name}", joint.name), list.len(), times.len())?;
        }
        for Series { name: what, times, values, .. } in &self.series {
            same(format!("{what} of {name}"), values.len(), times.len())?;
        }
        match self.stops.iter().find(|k| **k as usize >= times.len()) {
            None => Ok(()),
            Some(&index) => Err(ReportError::Index {
                what: format!("stop of {name}"),
                index: index as usize,
                known: times.len(),
            }),
        }
    }
}
