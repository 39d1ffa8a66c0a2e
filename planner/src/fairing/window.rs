//! How wide a piece is averaged where.

/// Spacing of the places at which widths are kept. \[m\]
const GRID: f64 = 0.002;
/// The widest windows, of the pad's place, of its heading, and of the joints. \[m\]
const PLACE: f64 = 0.2;
const HEADING: f64 = 0.4;
const JOINTS: f64 = 0.4;
/// Steepest change along the way of a window's share, and of a bend's room. \[1/m\]
const STEEPEST: f64 = 8.0;
const STEEPEST_ROOM: f64 = 25.0;
/// Half of the length over which changes of the share are rounded. \[m\]
const ROUNDED: f64 = 0.02;
/// How many times that length it is looked farther for room to narrow.
const AROUND: i32 = 12;
/// A window that would be narrower than this share is none.
const NARROWEST: f64 = 0.05;

/// The lengths that an average is taken over. \[m\]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    /// Of the pad's place and normal.
    pub(super) place: f64,
    /// Of its heading.
    pub(super) heading: f64,
    /// Of the joints, which says what they do in the null space.
    pub(super) joints: f64,
}

/// The windows along a piece.
pub(super) struct Windows {
    /// Of the pad.
    pad: Shares,
    /// Of the joints: where the pad goes, and so what it sweeps, does not depend on them.
    joints: Shares,
    /// Of what the way may be bent aside.
    bend: Shares,
}

impl Windows {
    /// The widest, along a piece of some length. \[m\]
    pub(super) fn new(length: f64) -> Self {
        let [pad, joints] = std::array::from_fn(|_| Shares::new(length, STEEPEST));
        Self { pad, joints, bend: Shares::new(length, STEEPEST_ROOM) }
    }

    /// At a place of it. At its ends there is none, so that it ends where it did.
    pub(super) fn at(&self, u: f64) -> Window {
        Window {
            place: self.pad.of(PLACE, u),
            heading: self.pad.of(HEADING, u),
            joints: self.joints.of(JOINTS, u),
        }
    }

    /// The share of the room there is that the way may be bent aside by at a place.
    pub(super) fn room(&self, u: f64) -> f64 {
        self.bend.share(u)
    }

    /// Halves that room around some places, where none is left a little farther around them; whether any
    /// was left to halve.
    pub(super) fn narrow_room(&mut self, places: &[f64]) -> bool {
        (0..=AROUND).any(|k| {
            let aside = f64::from(k) * ROUNDED;
            let around = places.iter().flat_map(|u| [(u - aside).max(0.0), u + aside]);
            let mut around: Vec<f64> = around.collect();
            around.sort_by(f64::total_cmp);
            self.bend.narrow(&around, 0.0)
        })
    }

    /// Halves the pad's windows around some places, down to `least` of the widest; whether any was left
    /// to halve.
    pub(super) fn narrow_pad(&mut self, places: &[f64], least: f64) -> bool {
        self.pad.narrow(places, least)
    }

    /// Halves all windows around some places; whether any was left to halve.
    pub(super) fn narrow(&mut self, places: &[f64]) -> bool {
        let pad = self.pad.narrow(places, 0.0);
        self.joints.narrow(places, 0.0) || pad
    }
}

/// Shares of the widest window along a piece.
struct Shares {
    length: f64,
    /// Their steepest change. \[1/m\]
    steepest: f64,
    /// As asked for.
    asked: Vec<f64>,
    /// Rounded.
    shares: Vec<f64>,
}

impl Shares {
    fn new(length: f64, steepest: f64) -> Self {
        let count = (length / GRID).ceil().max(1.0) as usize + 1;
        let whole = vec![1.0; count];
        Self { length, steepest, asked: whole.clone(), shares: whole }
    }

    /// The window at a place of which this is the widest. \[m\]
    fn of(&self, width: f64, u: f64) -> f64 {
        let room = 2.0 * u.min(self.length - u).max(0.0);
        match self.share(u) * width {
            0.0 => 0.0,
            _ if room == 0.0 => 0.0,
            wide => wide * room / libm::pow(wide.powi(4) + room.powi(4), 0.25),
        }
    }

    /// At a place.
    fn share(&self, u: f64) -> f64 {
        let last = (self.shares.len() - 1) as f64;
        let place = (u / self.length * last).clamp(0.0, last);
        let k = (place as usize).min(self.shares.len().saturating_sub(2));
        let rest = place - k as f64;
        self.shares[k] * (1.0 - rest) + self.shares[k + 1] * rest
    }

    fn narrow(&mut self, places: &[f64], least: f64) -> bool {
        let count = self.asked.len();
        let spacing = self.length / (count - 1) as f64;
        let index = |u: f64| ((u / spacing).round() as usize).min(count - 1);
        let mut indices: Vec<usize> = places.iter().map(|u| index(*u)).collect();
        indices.dedup();
        let mut any = false;
        let was = self.asked.clone();
        for &k in &indices {
            let share = was[k];
            any |= share > least;
            let half = if 0.5 * share < NARROWEST { 0.0 } else { 0.5 * share };
            self.asked[k] = half.max(least).min(share);
        }
        let step = self.steepest * spacing;
        for k in 1..count {
            self.asked[k] = self.asked[k].min(self.asked[k - 1] + step);
        }
        for k in (0..count - 1).rev() {
            self.asked[k] = self.asked[k].min(self.asked[k + 1] + step);
        }
        let reach = (ROUNDED / spacing) as usize;
        self.shares = (0..count)
            .map(|k| {
                // Nothing is to be averaged where nothing was asked for.
                let reach = reach.min(k).min(count - 1 - k);
                let around = &self.asked[k - reach..=k + reach];
                let mean = around.iter().sum::<f64>() / around.len() as f64;
                if self.asked[k] == 0.0 { 0.0 } else { mean }
            })
            .collect();
        any
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_swept_narrows_the_pads_windows_and_not_those_of_the_joints() {
        let mut windows = Windows::new(1.0);
        let before = windows.at(0.5);
        while windows.narrow_pad(&[0.5], 0.25) {}
        let after = windows.at(0.5);
        assert!((after.place / before.place - 0.25).abs() < 0.1, "{before:?} {after:?}");
        assert!(after.heading < 0.5 * before.heading);
        assert_eq!(after.joints, before.joints);
        while windows.narrow_pad(&[0.5], 0.0) {}
        assert_eq!(windows.at(0.5).place, 0.0);
        assert_eq!(windows.at(0.5).joints, before.joints);
        while windows.narrow(&[0.5]) {}
        assert_eq!(windows.at(0.5).joints, 0.0);
    }
}
