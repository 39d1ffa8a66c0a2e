//! Several views of one thing, each laid onto those before it.

use std::path::Path;

use anyhow::Context;
use nalgebra::Isometry3;
use nullsweep_planner::progress::Progress;
use nullsweep_surface::PlacedScan;
use nullsweep_surface::register::register;

use crate::bars::Bars;

/// Moves a placed scan to where it fits the others, if that is clearly better than where it stands,
/// says so, and gives the motion; fails where the fit is not to be trusted.
pub(super) fn lay(
    others: &PlacedScan,
    scan: &mut PlacedScan,
    path: &Path,
    bars: &Bars,
) -> anyhow::Result<Isometry3<f64>> {
    let mut moved = Isometry3::identity();
    for view in &mut scan.views {
        let found = register(&others.views, view)
            .with_context(|| format!("{}: it does not fit the scans before it", path.display()))?;
        let figures =
            format!("{:.0} % overlap, {:.1} mm apart", found.overlap * 100.0, found.residual * 1e3);
        if found.is_needed() {
            bars.note(&format!(
                "{}: laid onto the scans before it: moved by {:.1} mm, turned by {:.2}\u{b0}; now \
                 {figures}, before {:.0} %, {:.1} mm",
                path.display(),
                found.moved * 1e3,
                found.turned.to_degrees(),
                found.overlap_before * 100.0,
                found.residual_before * 1e3
            ));
            for point in &mut view.points {
                *point = found.correction * *point;
            }
            view.sensor = view.sensor.map(|sensor| found.correction * sensor);
            moved = found.correction;
        } else {
            bars.note(&format!("{}: fits the scans before it: {figures}", path.display()));
        }
    }
    Ok(moved)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use nullsweep_surface::{Placement, place, simulate};

    use super::*;

    #[test]
    fn a_view_that_fits_stays_one_that_is_off_is_laid_and_one_of_elsewhere_is_refused() {
        let [one, two] = simulate::chair_twice(1);
        let placed = |view: &simulate::SimulatedView, off: Isometry3<f64>| {
            place(&view.scan, &Placement::SensorPose(off * view.sensor_pose)).0
        };
        let first = placed(&one, Isometry3::identity());
        let right = placed(&two, Isometry3::identity());
        let (path, bars) = (Path::new("two.pcd"), Bars::new());

        let mut scan = right.clone();
        assert_eq!(lay(&first, &mut scan, path, &bars).unwrap(), Isometry3::identity());
        assert_eq!(scan, right);

        let off = Isometry3::new(Vector3::new(0.025, 0.0, 0.01), Vector3::new(0.0, 0.0, 0.03));
        let mut scan = placed(&two, off);
        lay(&first, &mut scan, path, &bars).unwrap();
        let pairs = scan.views[0].points.iter().zip(&right.views[0].points);
        let count = right.views[0].points.len() as f64;
        let mean = pairs.map(|(a, b)| (a - b).norm()).sum::<f64>() / count;
        assert!(mean < 0.003, "{mean:.4} m off on average");

        let mut scan = placed(&two, Isometry3::translation(3.0, 0.0, 0.0));
        let error = lay(&first, &mut scan, path, &bars).unwrap_err();
        assert!(format!("{error:#}").contains("two.pcd: it does not fit"), "{error:#}");
        assert!(crate::advice::advice(&error).is_some_and(|text| text.contains("--as-placed")));
    }
}
