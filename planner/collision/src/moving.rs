//! The shapes that move with the arm, prepared for the fast check, and how points may touch them.

use nalgebra::Vector3;
use nullsweep_robot::Tool;
use parry3d_f64::shape::SharedShape;

use crate::bodies::Bodies;
use crate::frame::Frame;
use crate::parts::Part;
use crate::rules::Margins;
use crate::solid::Solid;
use crate::spheres::SphereTree;

/// A shape that moves with the arm.
pub(crate) struct Moving {
    pub(crate) body: usize,
    /// Pose in the body frame.
    pub(crate) place: Frame,
    pub(crate) solid: Solid,
    pub(crate) shape: SharedShape,
    /// In the body frame.
    pub(crate) tree: SphereTree,
    /// Indices of the fixed shapes to check against.
    pub(crate) against: Vec<usize>,
    /// How points may touch it, if they may.
    pub(crate) touch: Option<Touch>,
}

/// How a shape that does not move against the tip may touch points.
pub(crate) enum Touch {
    /// Rigid: by this margin. \[m\]
    Rigid(f64),
    /// The pad: anything in its prism.
    Pad(Pad),
    /// A tool that works from afar: nothing, and least of all what it keeps out of.
    Afar,
}

/// Where the pad keeps its margin while it may touch.
pub(crate) struct Pad {
    /// Margin to points outside the prism. \[m\]
    pub(crate) margin: f64,
    /// Boxes (contact frame) that hold all places outside the prism within the margin. \[m\]
    pub(crate) keep_out: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Their corners, in the body frame. \[m\]
    corners: Vec<Vector3<f64>>,
    /// The boxes as solids, and spheres that cover them, in the body frame.
    pub(crate) guards: Vec<(Frame, Solid)>,
    pub(crate) tree: SphereTree,
}

/// The contact prism.
pub(crate) struct Contact {
    /// Contact frame in the tip's body.
    pub(crate) frame: Frame,
    /// Bounds in the contact frame. \[m\]
    pub(crate) min: Vector3<f64>,
    pub(crate) max: Vector3<f64>,
    /// Whether the tool works by touching.
    touches: bool,
}

impl Moving {
    /// A part that the body carries; `touch` is for those that are rigid to the tip.
    pub(crate) fn new(part: &Part, body: usize, place: Frame, touch: Option<Touch>) -> Self {
        Self {
            body,
            place,
            solid: part.solid.clone(),
            shape: part.shape.clone(),
            tree: SphereTree::new(&part.solid, &place),
            against: Vec::new(),
            touch,
        }
    }

    /// Upper bound of the distance of the shape, and of the places that it guards while it may
    /// touch, from the line through the body's origin along the unit vector `axis`. \[m\]
    pub(crate) fn reach_from_axis(&self, axis: &Vector3<f64>) -> f64 {
        let beside = |c: &Vector3<f64>| (c - axis * axis.dot(c)).norm();
        self.corners().map(beside).fold(self.tree.reach_from_axis(axis), f64::max)
    }

    /// The same, from a point of the body. \[m\]
    pub(crate) fn reach_from(&self, origin: &Vector3<f64>) -> f64 {
        let away = |c: &Vector3<f64>| (c - origin).norm();
        self.corners().map(away).fold(self.tree.reach_from(origin), f64::max)
    }

    fn corners(&self) -> impl Iterator<Item = &Vector3<f64>> {
        let pad = match &self.touch {
            Some(Touch::Pad(pad)) => Some(pad),
            _ => None,
        };
        pad.into_iter().flat_map(|pad| &pad.corners)
    }
}

impl Contact {
    pub(crate) fn new(bodies: &Bodies, tool: &Tool, margins: &Margins) -> Self {
        let contact_in_tip = Frame::from(&tool.contact_in_tip());
        let [x, y] = tool.half_sides();
        let half = Vector3::new(x, y, 0.0);
        let growth = Vector3::new(margins.contact_growth, margins.contact_growth, 0.0);
        Self {
            frame: bodies.tip.then(&contact_in_tip),
            min: -half - growth - Vector3::new(0.0, 0.0, tool.press_max),
            max: half + growth + Vector3::new(0.0, 0.0, margins.contact_front),
            touches: tool.touches(),
        }
    }
}

impl Touch {
    /// `None` for a part that keeps its full margin whatever the tool does.
    pub(crate) fn new(
        part: &Part,
        place: &Frame,
        contact: &Contact,
        margins: &Margins,
    ) -> Option<Self> {
        match (contact.touches, part.is_pad) {
            (true, true) => Some(Self::Pad(Pad::new(part, place, contact, margins))),
            (true, false) => Some(Self::Rigid(margins.environment.min(margins.contact_clearance))),
            (false, true) => Some(Self::Afar),
            (false, false) => None,
        }
    }
}

impl Pad {
    fn new(part: &Part, place: &Frame, contact: &Contact, margins: &Margins) -> Self {
        let margin = margins.environment.min(margins.contact_growth);
        // Bounds of the shape grown by its margin, in the contact frame.
        let local = contact.frame.inverse_then(place);
        let (low, high) = part.solid.bounds();
        let centre = local.apply(&(0.5 * (low + high)));
        let half = local.rotation.abs() * (0.5 * (high - low)) + Vector3::repeat(margin);
        let (min, max) = (centre - half, centre + half);
        let mut keep_out = Vec::new();
        for axis in 0..3 {
            if max[axis] > contact.max[axis] + 1e-9 {
                let mut from = min;
                from[axis] = min[axis].max(contact.max[axis]);
                keep_out.push((from, max));
            }
            if min[axis] < contact.min[axis] - 1e-9 {
                let mut to = max;
                to[axis] = max[axis].min(contact.min[axis]);
                keep_out.push((min, to));
            }
        }
        let (mut guards, mut tree) = (Vec::new(), SphereTree::default());
        for (low, high) in &keep_out {
            let cover = Solid::Box { half: 0.5 * (high - low) };
            let at = Frame { translation: 0.5 * (low + high), ..Frame::IDENTITY };
            let at = contact.frame.then(&at);
            tree.append(&SphereTree::new(&cover, &at));
            guards.push((at, cover));
        }
        let corners = keep_out
            .iter()
            .flat_map(|(low, high)| {
                (0..8).map(move |n| {
                    let pick = |i: usize| if n >> i & 1 == 0 { low[i] } else { high[i] };
                    Vector3::new(pick(0), pick(1), pick(2))
                })
            })
            .map(|corner| contact.frame.apply(&corner))
            .collect();
        Self { margin, keep_out, corners, guards, tree }
    }
}
