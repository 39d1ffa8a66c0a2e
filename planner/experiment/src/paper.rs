//! The published tables I and II, to stand beside ours.

use nullsweep_planner::plan::{CostKind, Method};

use crate::{Object, Quantity};

/// A published mean with its standard deviation.
pub type Published = (f64, f64);

/// The numbers of samples that the paper's tables have: none redundant, the most that its
/// Joint-GTSP could take, and many.
#[must_use]
pub fn samples(object: Object) -> [usize; 3] {
    match object {
        Object::Chair => [1, 3, 100],
        Object::BobbyCar => [1, 9, 100],
    }
}

/// What the paper prints in a cell; `None` for N/A and for numbers of samples that it has not.
#[must_use]
pub fn cell(
    object: Object,
    optimised: CostKind,
    samples: usize,
    method: Method,
    quantity: Quantity,
) -> Option<Published> {
    let block = self::samples(object).iter().position(|&s| s == samples)?;
    let table = match object {
        Object::Chair => &CHAIR,
        Object::BobbyCar => &BOBBY_CAR,
    };
    let column = match method {
        Method::Tsp => 0,
        Method::Curvature => 1,
        Method::Joint => 2,
        Method::Raster => return None,
    };
    let side = match optimised {
        CostKind::Time => 0,
        CostKind::Effort => 1,
    };
    let row = match quantity {
        Quantity::Distance => 0,
        Quantity::Effort => 1,
        Quantity::Time => 2,
        Quantity::Calculation => 3,
        Quantity::Processor => return None,
    };
    let (mean, deviation) = table[side][block][row][column];
    (mean > 0.0).then_some((mean, deviation))
}

/// Why a published cell cannot hold, if so: no joint is faster than v_max = 2 rad/s, so that in
/// every motion the sum of the displacements is at least the largest of them, 2 rad/s · time.
#[must_use]
pub fn cannot_hold(effort: Published, time: Published) -> Option<f64> {
    let ratio = 2.0 * time.0 / effort.0;
    (ratio > 1.0).then_some(ratio)
}

const NA: Published = (0.0, 0.0);

/// [optimised: time, effort][block of samples][distance, effort, time, calculation][TSP, Curvature,
/// Joint].
type Table = [[[[Published; 3]; 4]; 3]; 2];

const CHAIR: Table = [
    [
        [
            [(9.54, 0.0), (12.03, 0.23), (12.26, 0.18)],
            [(336.46, 3.34), (228.25, 5.21), (218.59, 5.05)],
            [(153.46, 1.55), (97.76, 2.17), (94.58, 2.15)],
            [(3.84, 0.36), (114.40, 9.20), (118.03, 6.68)],
        ],
        [
            [(9.54, 0.0), (12.04, 0.12), (13.03, 0.26)],
            [(327.66, 2.29), (220.41, 2.97), (214.24, 5.69)],
            [(138.34, 1.47), (87.15, 1.48), (84.53, 2.64)],
            [(3.73, 0.15), (129.60, 7.76), (1649.11, 150.90)],
        ],
        [
            [(9.54, 0.0), (12.09, 0.16), NA],
            [(303.54, 4.93), (205.17, 4.53), NA],
            [(101.60, 1.53), (69.91, 1.47), NA],
            [(23.92, 0.69), (148.42, 8.64), NA],
        ],
    ],
    [
        [
            [(9.54, 0.0), (12.11, 0.25), (12.09, 0.21)],
            [(335.88, 3.27), (228.70, 5.67), (215.65, 3.37)],
            [(153.19, 1.51), (98.15, 2.34), (95.43, 1.56)],
            [(4.12, 0.48), (133.27, 8.07), (131.06, 7.83)],
        ],
        [
            [(9.54, 0.0), (12.19, 0.19), (13.10, 0.35)],
            [(305.39, 1.96), (204.59, 3.28), (183.73, 4.02)],
            [(141.67, 1.42), (93.48, 1.97), (86.98, 1.99)],
            [(4.19, 0.31), (137.88, 8.50), (1808.6, 182.45)],
        ],
        [
            [(9.54, 0.0), (12.18, 0.30), NA],
            [(206.81, 1.44), (134.49, 5.66), NA],
            [(159.46, 3.57), (101.56, 1.51), NA],
            [(12.01, 0.41), (152.72, 14.40), NA],
        ],
    ],
];

const BOBBY_CAR: Table = [
    [
        [
            [(5.89, 0.0), (7.61, 0.19), (7.48, 0.15)],
            [(206.66, 3.52), (180.27, 3.52), (157.29, 4.02)],
            [(85.00, 0.36), (72.08, 1.65), (63.31, 1.59)],
            [(1.06, 0.25), (30.01, 1.89), (31.07, 3.38)],
        ],
        [
            [(5.89, 0.0), (7.88, 0.22), (8.49, 0.29)],
            [(202.70, 3.93), (174.92, 7.90), (169.28, 6.13)],
            [(72.25, 0.56), (61.60, 1.93), (60.85, 1.65)],
            [(1.15, 0.09), (30.84, 1.86), (1549.44, 183.41)],
        ],
        [
            [(5.89, 0.0), (7.60, 0.15), NA],
            [(202.19, 3.84), (164.03, 4.04), NA],
            [(68.14, 0.32), (54.86, 1.34), NA],
            [(4.29, 0.29), (35.25, 3.43), NA],
        ],
    ],
    [
        [
            [(5.89, 0.0), (7.49, 0.12), (7.53, 0.16)],
            [(205.33, 3.49), (176.95, 6.95), (153.07, 3.57)],
            [(84.80, 0.60), (70.92, 2.45), (63.67, 1.48)],
            [(1.11, 0.24), (32.16, 2.51), (26.58, 0.81)],
        ],
        [
            [(5.89, 0.0), (7.73, 0.14), (8.97, 0.30)],
            [(171.67, 2.22), (143.83, 4.15), (137.50, 7.78)],
            [(81.00, 0.41), (67.10, 2.55), (68.42, 3.37)],
            [(1.17, 0.13), (31.98, 2.10), (2255.48, 213.98)],
        ],
        [
            [(5.89, 0.0), (7.61, 0.16), NA],
            [(159.70, 2.67), (131.88, 5.86), NA],
            [(85.44, 0.90), (68.63, 3.05), NA],
            [(2.47, 0.36), (33.50, 1.94), NA],
        ],
    ],
];

/// Mean and sample standard deviation.
pub(super) fn statistic(values: impl Iterator<Item = f64> + Clone) -> Published {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let squares: f64 = values.map(|v| (v - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_published_cells_cannot_hold() {
        let mut found = Vec::new();
        for object in [Object::Chair, Object::BobbyCar] {
            for optimised in [CostKind::Time, CostKind::Effort] {
                for samples in samples(object) {
                    for method in [Method::Tsp, Method::Curvature, Method::Joint] {
                        let at = |quantity| cell(object, optimised, samples, method, quantity);
                        let pair = at(Quantity::Effort).zip(at(Quantity::Time));
                        if let Some(ratio) = pair.and_then(|(e, t)| cannot_hold(e, t)) {
                            found.push((object, optimised, samples, method, ratio));
                        }
                    }
                }
            }
        }
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(found.iter().all(|f| f.1 == CostKind::Effort && f.2 == 100), "{found:?}");
    }
}
