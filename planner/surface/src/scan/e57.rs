//! E57: scans of a terrestrial scanner, each with its pose.

use std::io::Cursor;

use e57::{CartesianCoordinate, E57Reader, Transform};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};

use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// Reads all scans of the file, each at its pose; records without a valid point are left out.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
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
    parsed.viewpoint = match &clouds[..] {
        [cloud] => cloud.transform.as_ref().and_then(pose),
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

fn pose(transform: &Transform) -> Option<Isometry3<f64>> {
    let (turn, place) = (&transform.rotation, &transform.translation);
    let turn = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    let place = Translation3::new(place.x, place.y, place.z);
    let is_sound = turn.coords.iter().chain(place.vector.iter()).all(|x| x.is_finite());
    let turn = UnitQuaternion::try_new(turn, 1e-6).filter(|_| is_sound)?;
    Some(Isometry3::from_parts(place, turn))
}
