//! E57: scans of a terrestrial scanner, each with its pose.

use std::io::Cursor;

use e57::{CartesianCoordinate, E57Reader, Transform};
use nalgebra::Point3;

use super::error::{Malformed, Place, malformed};
use super::guarded::guarded;
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// Reads all scans of the file, each at its pose; records without a valid point are left out.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    guarded(|| read(bytes))
}

fn read(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let wrong = |error: e57::Error| Malformed { place: Place::File, cause: error.to_string() };
    let mut file = E57Reader::new(Cursor::new(bytes)).map_err(wrong)?;
    let mut parsed = Parsed::default();
    let clouds = file.pointclouds();
    let mut missing = 0;
    for cloud in &clouds {
        // Each record takes at least a bit, if any of its values is stored at all.
        if cloud.records > 8 * bytes.len() as u64 {
            let cause = format!("{} points in a file of {} bytes", cloud.records, bytes.len());
            return malformed(Place::File, cause);
        }
        for point in file.pointcloud_simple(cloud).map_err(wrong)? {
            match point.map_err(wrong)?.cartesian {
                CartesianCoordinate::Valid { x, y, z } => parsed.points.push(Point3::new(x, y, z)),
                _ => missing += 1,
            }
        }
    }
    parsed.sensor = match &clouds[..] {
        [cloud] => place(cloud.transform.as_ref()),
        _ => None,
    };
    if missing > 0 {
        parsed.warnings.push(ScanWarning::NonFinite { dropped: missing });
    }
    parsed.warnings.push(ScanWarning::Convention {
        told: format!("{} scan(s) of an E57 file, each moved to where its pose says", clouds.len()),
    });
    Ok(parsed)
}

/// Where a scanner stood, by its pose: at the origin if it has none.
fn place(transform: Option<&Transform>) -> Option<Point3<f64>> {
    let Some(transform) = transform else { return Some(Point3::origin()) };
    let at = &transform.translation;
    let at = Point3::new(at.x, at.y, at.z);
    at.iter().all(|x| x.is_finite()).then_some(at)
}

#[cfg(test)]
mod tests {
    use e57::{E57Writer, Quaternion, Record, RecordValue, Translation};

    use super::*;

    /// A grid of 200 points in a plane, seen from a scanner 2 m up and turned a quarter.
    fn file(scans: usize) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
        for scan in 0..scans {
            let prototype =
                vec![Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
            let mut cloud = writer.add_pointcloud(&format!("scan{scan}"), prototype).unwrap();
            let half = std::f64::consts::FRAC_1_SQRT_2;
            cloud.set_transform(Some(Transform {
                rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
                translation: Translation { x: 0.0, y: 0.0, z: 2.0 },
            }));
            for i in 0..200 {
                let (x, y) = (f64::from(i % 20), f64::from(i / 20));
                let values = [x, y, -2.0].map(RecordValue::Double);
                cloud.add_point(values.into()).unwrap();
            }
            cloud.finalize().unwrap();
        }
        writer.finalize().unwrap();
        drop(writer);
        bytes.into_inner()
    }

    #[test]
    fn every_scan_is_moved_to_its_pose() {
        let one = parse(&file(1)).unwrap();
        assert_eq!(one.points.len(), 200);
        assert!((one.points[23] - Point3::new(-1.0, 3.0, 0.0)).norm() < 1e-9, "{}", one.points[23]);
        assert_eq!((one.sensor, one.viewpoint), (Some(Point3::new(0.0, 0.0, 2.0)), None));
        let two = parse(&file(2)).unwrap();
        assert_eq!((two.points.len(), two.sensor), (400, None));
        assert!(two.warnings[0].to_string().starts_with("2 scan(s)"));
    }

    #[test]
    fn broken_files_are_refused_without_a_panic() {
        let whole = file(1);
        for cut in (0..whole.len()).step_by(97) {
            assert!(parse(&whole[..cut]).is_err(), "{cut} of {}", whole.len());
        }
        for at in (0..whole.len()).filter(|at| *at < 64 || at % 13 == 0) {
            for value in [0x00, 0xFF] {
                let mut bytes = whole.clone();
                bytes[at] = value;
                let _ = parse(&bytes);
            }
        }
    }
}
