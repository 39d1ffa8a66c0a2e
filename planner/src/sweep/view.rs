//! What a tool that works from afar sees from one pose: the nearest along a bundle of rays.

use nalgebra::Point3;

/// What is farther behind the nearest on a ray than this many spacings of the scan is hidden: a surface
/// aslant by 60° is not hidden by itself.
const BEHIND: f64 = 4.0;
/// Nearer before the tool than this nothing is looked at. \[m\]
const NEAREST: f64 = 1e-3;
/// Most rays that a point stops to either side.
const WIDEST: f64 = 16.0;

/// A bundle of rays from the contact frame's origin along z, each with the nearest that stops it.
pub(super) struct View {
    nearest: Vec<f64>,
    /// Slopes at which the bundle ends, along x and y.
    ends: [f64; 2],
    /// Of two rays side by side.
    step: f64,
    sides: [usize; 2],
    spacing: f64,
}

impl View {
    /// Rays as far apart as the scan's points at a distance.
    pub(super) fn new([across, along]: [f64; 2], distance: f64, spacing: f64) -> Self {
        let ends = [along, across];
        let step = (spacing / distance).max(0.01 * across.max(along));
        let sides = ends.map(|end| (2.0 * end / step).ceil() as usize + 1);
        Self { nearest: vec![f64::INFINITY; sides[0] * sides[1]], ends, step, sides, spacing }
    }

    /// The ray nearest to a place, counted from the first along both axes.
    fn ray(&self, place: &Point3<f64>) -> [f64; 2] {
        let at = |slope: f64, end: f64| ((slope + end) / self.step).round();
        [at(place.x / place.z, self.ends[0]), at(place.y / place.z, self.ends[1])]
    }

    /// Stops the rays that pass a point no farther than half the scan's spacing.
    pub(super) fn stop(&mut self, place: &Point3<f64>) {
        if place.z < NEAREST {
            return;
        }
        let at = self.ray(place);
        let wide = (0.5 * self.spacing / (place.z * self.step)).ceil().min(WIDEST);
        let range = |k: usize| {
            let last = (self.sides[k] - 1) as f64;
            let (from, to) = ((at[k] - wide).max(0.0), (at[k] + wide).min(last));
            if from > to { 0..0 } else { from as usize..to as usize + 1 }
        };
        for row in range(0) {
            for column in range(1) {
                let nearest = &mut self.nearest[row * self.sides[1] + column];
                *nearest = nearest.min(place.z);
            }
        }
    }

    /// Whether the rays come to a place.
    pub(super) fn shows(&self, place: &Point3<f64>) -> bool {
        let at = self.ray(place);
        let inside = (0..2).all(|k| (0.0..self.sides[k] as f64).contains(&at[k]));
        inside && {
            let nearest = self.nearest[at[0] as usize * self.sides[1] + at[1] as usize];
            place.z <= nearest + BEHIND * self.spacing
        }
    }
}
