//! What a tool works on: the one place that tells pads, discs, rollers, nozzles and cameras apart.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{UnitQuaternion, Vector3};

use super::footprint::{Camera, Footprint, Nozzle, Roller, ToolBody};
use super::tool::Tool;

/// Share of the radius of what a nozzle sprays that strips are apart: the sum of two parabolas side by
/// side is even to a tenth there.
const NOZZLE_PITCH: f64 = 0.85;
/// Share of its view across that strips of a camera are apart.
const CAMERA_PITCH: f64 = 0.7;
/// How much less than half of what it works on that is. \[m\]
const BEYOND: f64 = 0.005;
/// What strips of a pad share. \[m\]
const OVERLAP: f64 = 0.008;

impl Tool {
    /// Whether it works by touching; else it works from afar, and nothing of it may touch anything.
    #[must_use]
    pub fn touches(&self) -> bool {
        match self.footprint {
            Footprint::Rectangle | Footprint::Disc | Footprint::Roller(_) => true,
            Footprint::Nozzle(_) | Footprint::Camera(_) => false,
        }
    }

    /// Whether its heading is free: turned about its axis it works on the same.
    #[must_use]
    pub fn is_round(&self) -> bool {
        matches!(self.footprint, Footprint::Disc | Footprint::Nozzle(_))
    }

    /// The angle over which headings are looked at: half a turn where a heading and its opposite are
    /// the same contact, else a whole one (of a round tool too: the arm behind it is not round).
    /// \[rad\]
    #[must_use]
    pub fn heading_range(&self) -> f64 {
        if self.symmetric && !self.is_round() { PI } else { TAU }
    }

    /// The turns from a heading that are as good as it. \[rad\]
    #[must_use]
    pub fn turns(&self) -> &'static [f64] {
        match (self.is_round(), self.symmetric) {
            (true, _) => &[0.0, FRAC_PI_2, PI, -FRAC_PI_2],
            (false, true) => &[0.0, PI],
            (false, false) => &[0.0],
        }
    }

    /// The angle of the turn between two contact frames, by the heading that makes it least among
    /// those that are as good. \[rad\]
    #[must_use]
    pub fn turn_between(&self, turn: &UnitQuaternion<f64>) -> f64 {
        if self.is_round() {
            return (turn * Vector3::z()).angle(&Vector3::z());
        }
        let angle = turn.angle();
        if !self.symmetric {
            return angle;
        }
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI);
        angle.min((turn * half_turn).angle())
    }

    /// Whether it may travel at an angle from its contact frame's x axis. \[rad\]
    #[must_use]
    pub fn may_travel(&self, angle: f64) -> bool {
        let Footprint::Roller(Roller { slip_max, .. }) = self.footprint else { return true };
        let from = angle.abs().rem_euclid(TAU);
        let ahead = from.min(TAU - from);
        let slip = if self.symmetric { ahead.min(PI - ahead) } else { ahead };
        slip <= slip_max
    }

    /// Whether its direction of travel is bound to its heading.
    #[must_use]
    pub fn rolls(&self) -> bool {
        matches!(self.footprint, Footprint::Roller(_))
    }

    /// How long what it works on is, across the travel and along it, on a level surface at its
    /// stand-off. \[m\]
    #[must_use]
    pub fn track(&self) -> [f64; 2] {
        match self.footprint {
            Footprint::Rectangle | Footprint::Disc | Footprint::Roller(_) => {
                [self.length, self.width]
            }
            Footprint::Nozzle(Nozzle { cone, .. }) => [2.0 * self.stand_off * libm::tan(cone); 2],
            Footprint::Camera(Camera { field_of_view, .. }) => {
                field_of_view.map(|angle| 2.0 * self.stand_off * libm::tan(0.5 * angle))
            }
        }
    }

    /// How far strips beside each other may be apart. \[m\]
    #[must_use]
    pub fn pitch(&self) -> f64 {
        let [across, _] = self.track();
        match self.footprint {
            Footprint::Rectangle | Footprint::Roller(_) => (across - OVERLAP).max(0.5 * across),
            Footprint::Disc => 0.75 * across,
            Footprint::Nozzle(_) => 0.5 * NOZZLE_PITCH * across,
            Footprint::Camera(_) => CAMERA_PITCH * across,
        }
    }

    /// How far within the ends of what is to be worked on its middle may stay. \[m\]
    #[must_use]
    pub fn strip_inset(&self) -> f64 {
        let [_, along] = self.track();
        match self.footprint {
            Footprint::Nozzle(_) => 0.0,
            _ => (0.5 * along - BEYOND).max(0.0),
        }
    }

    /// Radius of the disc about its middle that it works on whatever its heading, by one pass. \[m\]
    #[must_use]
    pub fn inner_radius(&self) -> f64 {
        let [across, along] = self.track();
        match self.footprint {
            Footprint::Nozzle(_) => 0.25 * along,
            _ => 0.5 * along.min(across),
        }
    }

    /// Radius of the disc about its middle that holds all that it works on. \[m\]
    #[must_use]
    pub fn outer_radius(&self) -> f64 {
        let [across, along] = self.track();
        if self.is_round() { 0.5 * along } else { 0.5 * libm::hypot(along, across) }
    }

    /// Whether a place is under it, seen along its axis on the plane `stand_off` ahead: along x and
    /// along y of the contact frame. \[m\]
    #[must_use]
    #[inline]
    pub fn is_under(&self, x: f64, y: f64) -> bool {
        let [across, along] = self.track();
        x.abs() <= 0.5 * along
            && y.abs() <= 0.5 * across
            && (!self.is_round() || libm::hypot(x, y) <= 0.5 * along)
    }

    /// Whether it works on a place: along x and y of the contact frame, and so far behind the plane
    /// `stand_off` ahead. \[m\]
    #[must_use]
    #[inline]
    pub fn works_on(&self, x: f64, y: f64, behind: f64) -> bool {
        match self.footprint {
            Footprint::Rectangle | Footprint::Disc | Footprint::Roller(_) => {
                self.is_under(x, y) && behind.abs() <= self.reach_normal
            }
            Footprint::Nozzle(Nozzle { distance: [near, far], cone, .. }) => {
                let ahead = self.stand_off + behind;
                (near..=far).contains(&ahead) && libm::hypot(x, y) <= ahead * libm::tan(cone)
            }
            Footprint::Camera(Camera { distance: [near, far], .. }) => {
                let ahead = self.stand_off + behind;
                let [across, along] = self.slopes();
                (near..=far).contains(&ahead)
                    && x.abs() <= ahead * along
                    && y.abs() <= ahead * across
            }
        }
    }

    /// Nearest and farthest along its axis that it works, from the contact frame's plane. \[m\]
    #[must_use]
    pub fn distance(&self) -> [f64; 2] {
        match self.footprint {
            Footprint::Nozzle(Nozzle { distance, .. })
            | Footprint::Camera(Camera { distance, .. }) => distance,
            Footprint::Rectangle | Footprint::Disc | Footprint::Roller(_) => {
                [self.stand_off - self.reach_normal, self.stand_off + self.reach_normal]
            }
        }
    }

    /// The slopes from its axis at which what a tool that works from afar works on ends, along y and
    /// along x; 0 of one that touches.
    #[must_use]
    pub fn slopes(&self) -> [f64; 2] {
        match self.footprint {
            Footprint::Nozzle(Nozzle { cone, .. }) => [libm::tan(cone); 2],
            Footprint::Camera(Camera { field_of_view, .. }) => {
                field_of_view.map(|angle| libm::tan(0.5 * angle))
            }
            Footprint::Rectangle | Footprint::Disc | Footprint::Roller(_) => [0.0; 2],
        }
    }

    /// What keeps it from working on something is no nearer to its body than this. \[m\]
    #[must_use]
    pub fn farthest(&self) -> f64 {
        let [across, along] = self.slopes();
        self.hover() * (1.0 + across * across + along * along).sqrt()
    }

    /// Its speed where none is asked for; none: as fast as the joints allow. \[m/s\]
    #[must_use]
    pub fn own_speed(&self) -> Option<f64> {
        match self.footprint {
            Footprint::Nozzle(nozzle) => Some(nozzle.speed(self.pitch())),
            _ => None,
        }
    }

    /// Its body.
    #[must_use]
    pub fn body(&self) -> ToolBody {
        let half = 0.5 * self.thickness;
        match self.footprint {
            Footprint::Rectangle | Footprint::Camera(_) => {
                ToolBody::Box { half: [0.5 * self.width, 0.5 * self.length, half] }
            }
            Footprint::Disc | Footprint::Nozzle(_) => {
                ToolBody::Disc { radius: 0.5 * self.width, half }
            }
            Footprint::Roller(Roller { radius, .. }) => {
                ToolBody::Roller { radius, half: 0.5 * self.length }
            }
        }
    }

    /// Half of the sides of the rectangle under its body, along x and along y. \[m\]
    #[must_use]
    pub fn half_sides(&self) -> [f64; 2] {
        match self.footprint {
            Footprint::Roller(Roller { radius, .. }) => [radius, 0.5 * self.length],
            _ => [0.5 * self.width, 0.5 * self.length],
        }
    }
}
