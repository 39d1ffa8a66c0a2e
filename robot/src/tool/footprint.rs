//! What a tool does to the surface: pads, discs, rollers, nozzles and cameras.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

/// What a tool does to the surface, and by which numbers besides those that all tools have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Footprint {
    /// A pad of `length` × `width` that touches.
    #[default]
    Rectangle,
    /// A round pad, as long as it is wide, that touches: its heading is free.
    Disc,
    /// A roller of `length` across its travel that touches in a strip of `width`.
    Roller(Roller),
    /// A nozzle that sprays from afar.
    Nozzle(Nozzle),
    /// A camera or sensor that looks from afar.
    Camera(Camera),
}

/// A roller about the contact frame's y axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Roller {
    /// Of its body. \[m\]
    pub radius: f64,
    /// The greatest angle between its travel and the contact frame's x axis, forwards or
    /// backwards. \[rad\]
    pub slip_max: f64,
}

/// A nozzle at the contact frame's origin that sprays along z.
///
/// Its flow falls off from the axis as a parabola (the Beta distribution of spray models with β = 2):
/// across a plane at a distance d the flow per area is 2 q ∕ π R² · (1 − r² ∕ R²), R = d · tan cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nozzle {
    /// Nearest and farthest, along its axis, that it works. \[m\]
    pub distance: [f64; 2],
    /// Half of the cone's opening angle. \[rad\]
    pub cone: f64,
    /// What it sprays. \[m³/s\]
    pub rate: f64,
    /// The least and the most that is to lie on a point in the end. \[m\]
    pub deposit: [f64; 2],
}

/// A camera or sensor at the contact frame's origin that looks along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Nearest and farthest, along its axis, that it sees sharply. \[m\]
    pub distance: [f64; 2],
    /// Its full opening angles along the contact frame's y and x axes. \[rad\]
    pub field_of_view: [f64; 2],
}

/// A convex body behind the contact frame, seen from its origin. \[m\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToolBody {
    /// From the contact frame's plane back.
    Box {
        /// Half of its sides along x, y and z.
        half: [f64; 3],
    },
    /// About z, from the contact frame's plane back.
    Disc {
        /// Its radius.
        radius: f64,
        /// Half of its height.
        half: f64,
    },
    /// About y, the contact frame's plane its tangent.
    Roller {
        /// Its radius.
        radius: f64,
        /// Half of its length.
        half: f64,
    },
}

impl Footprint {
    /// As a tool's file names it.
    #[must_use]
    pub fn shape(&self) -> &'static str {
        match self {
            Self::Rectangle => "rectangle",
            Self::Disc => "disc",
            Self::Roller(_) => "roller",
            Self::Nozzle(_) => "nozzle",
            Self::Camera(_) => "camera",
        }
    }
}

impl Nozzle {
    /// What it lays onto a point of the surface, at a place and with a normal in its contact frame:
    /// the thickness that grows there, 0 outside its cone and on what faces away. \[m/s\]
    #[must_use]
    pub fn deposit_rate(&self, place: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        if place.z <= 0.0 {
            return 0.0;
        }
        let radius = place.z * libm::tan(self.cone);
        let beside = 1.0 - (place.x * place.x + place.y * place.y) / (radius * radius);
        let through = 2.0 * self.rate / (PI * radius * radius) * beside.max(0.0);
        // Through a plane across the axis; the surface lies aslant to the ray.
        through * (-normal.dot(&place.coords) / place.z).max(0.0)
    }

    /// The speed at which strips `pitch` apart \[m\] leave the middle of the wanted deposit. \[m/s\]
    #[must_use]
    pub fn speed(&self, pitch: f64) -> f64 {
        let [least, most] = self.deposit;
        self.rate / (pitch * (least * most).sqrt())
    }
}
