//! LAS and LAZ: points of a lidar, mostly at the coordinates of a map.

use std::io::Cursor;

use las::Reader;
use nalgebra::Point3;

use super::error::{Malformed, Place, malformed};
use super::guarded::guarded;
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// About as many bytes of points are read at a time.
const BLOCK: u64 = 1 << 22;
/// Coordinates beyond this are a map's. \[m\]
const MAP: f64 = 1e4;

/// Reads the points, offset and scale applied.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    guarded(|| read(bytes))
}

fn read(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let wrong = |error: las::Error| Malformed { place: Place::File, cause: error.to_string() };
    check_chunks(bytes)?;
    let mut file = Reader::new(Cursor::new(bytes.to_vec())).map_err(wrong)?;
    // What it says of itself sizes what is set aside for it.
    let (count, record) =
        (file.header().number_of_points(), u64::from(file.header().point_format().len()));
    let held = bytes.len() as u64;
    let is_packed = file.header().point_format().is_compressed;
    if record > held || !is_packed && count.saturating_mul(record) > held {
        return malformed(
            Place::File,
            format!("{count} points of {record} bytes each in a file of {held} bytes"),
        );
    }
    let at_a_time = (BLOCK / record.max(1)).max(1);
    let mut parsed = Parsed { sensor: None, ..Parsed::default() };
    loop {
        let block = file.read_points(at_a_time).map_err(wrong)?;
        if block.is_empty() {
            break;
        }
        let points = block.x().zip(block.y()).zip(block.z());
        parsed.points.extend(points.map(|((x, y), z)| Point3::new(x, y, z)));
    }
    let far = |p: &Point3<f64>| p.coords.amax() > MAP;
    if let Some(p) = parsed.points.first().filter(|p| far(p)) {
        parsed.warnings.push(ScanWarning::Convention {
            told: format!(
                "the coordinates are a map's, at {:.0}, {:.0}, {:.0} m, and taken for metres: places \
                 on the floor, as the robot's base, count from the map's origin",
                p.x, p.y, p.z
            ),
        });
    }
    Ok(parsed)
}

/// A LAZ file's table of chunks is made for as many as it announces: not more than there are bytes.
fn check_chunks(bytes: &[u8]) -> Result<(), Malformed> {
    let number = |at: usize, size: usize| {
        let bytes = bytes.get(at..at.checked_add(size)?)?;
        Some(bytes.iter().rev().fold(0u64, |n, byte| n << 8 | u64::from(*byte)))
    };
    let is_laz = number(104, 1).is_some_and(|format| format & 0xC0 != 0);
    if !is_laz {
        return Ok(());
    }
    let points = number(96, 4);
    let offset = |at: u64| number(usize::try_from(at).ok()?, 8);
    // Who could not go back to say where the table is says −1 there, and says it at the end.
    let behind = |table: &u64| {
        points.zip(i64::try_from(*table).ok()).is_some_and(|(points, table)| table > points as i64)
    };
    let table = points.and_then(offset).filter(behind).or_else(|| {
        let last = (bytes.len() as u64).checked_sub(8)?;
        offset(last)
    });
    let table = table.and_then(|at| usize::try_from(at).ok());
    let chunks = table.and_then(|at| number(at.checked_add(4)?, 4));
    match chunks {
        Some(chunks) if chunks <= bytes.len() as u64 => Ok(()),
        Some(chunks) => {
            malformed(Place::File, format!("{chunks} chunks in a file of {} bytes", bytes.len()))
        }
        None => malformed(Place::File, "the table of its chunks lies beyond its end"),
    }
}

#[cfg(test)]
mod tests {
    use las::point::Format;
    use las::{Builder, Header, Point, Writer};

    use super::*;

    fn file(compressed: bool, offset: f64) -> Vec<u8> {
        let mut builder = Builder::from((1, 2));
        let mut format = Format::new(0).unwrap();
        format.is_compressed = compressed;
        builder.point_format = format;
        builder.transforms.x.offset = offset;
        let header: Header = builder.into_header().unwrap();
        let mut writer = Writer::new(Cursor::new(Vec::new()), header).unwrap();
        for i in 0..200 {
            let (x, y) = (offset + 0.01 * f64::from(i % 20), 0.01 * f64::from(i / 20));
            writer.write_point(Point { x, y, z: 0.5, ..Point::default() }).unwrap();
        }
        writer.close().unwrap();
        writer.into_inner().unwrap().into_inner()
    }

    #[test]
    fn las_and_laz_hold_the_same_points() {
        let plain = parse(&file(false, 0.0)).unwrap();
        assert_eq!(plain.points.len(), 200);
        assert!((plain.points[21] - Point3::new(0.01, 0.01, 0.5)).norm() < 1e-3);
        assert_eq!(plain.warnings, []);
        let packed = parse(&file(true, 0.0)).unwrap();
        assert_eq!(packed.points, plain.points);
        let map = parse(&file(false, 4.5e5)).unwrap();
        assert!(map.warnings[0].to_string().contains("450000"), "{:?}", map.warnings);
    }

    /// Nothing is set aside for what cannot be there: records of 60,000 bytes, or 4 billion of them.
    #[test]
    fn what_a_file_says_of_itself_is_held_against_its_size() {
        for compressed in [false, true] {
            let mut long = file(compressed, 0.0);
            long[105..107].copy_from_slice(&59_904u16.to_le_bytes());
            let error = parse(&long).unwrap_err();
            assert!(error.cause.contains("points of 59904 bytes each"), "{error:?}");
        }
        let mut many = file(false, 0.0);
        many[107..111].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = parse(&many).unwrap_err();
        assert!(error.cause.starts_with("4294967295 points of 20 bytes"), "{error:?}");
    }

    /// As laszip writes to a pipe.
    #[test]
    fn a_stream_says_at_its_end_where_its_chunks_are() {
        let whole = file(true, 0.0);
        let at = u32::from_le_bytes(whole[96..100].try_into().unwrap()) as usize;
        let mut streamed = whole.clone();
        let table = whole[at..at + 8].to_vec();
        streamed[at..at + 8].copy_from_slice(&(-1i64).to_le_bytes());
        assert!(parse(&streamed).is_err());
        streamed.extend(table);
        assert_eq!(parse(&streamed).unwrap().points, parse(&whole).unwrap().points);
    }

    #[test]
    fn broken_files_are_refused_without_a_panic() {
        for compressed in [false, true] {
            let whole = file(compressed, 0.0);
            for cut in (0..whole.len()).step_by(7) {
                assert!(parse(&whole[..cut]).is_err(), "{cut} of {} bytes", whole.len());
            }
            for at in 0..whole.len() {
                for value in [0x00, 0x7F, 0xFF] {
                    let mut bytes = whole.clone();
                    bytes[at] = value;
                    let _ = parse(&bytes);
                }
            }
        }
    }
}
