//! Colours of scan files stay with their points.

use std::path::Path;

use nalgebra::{Isometry3, Point3};
use nullsweep_surface::scan::{Format, Placement, RawScan, ReadOptions, place, read_bytes};
use nullsweep_surface::{CropBox, ScanError};

/// 30 points on a plate; the tenth of them is none.
fn points() -> Vec<(Point3<f64>, [u8; 3])> {
    let at = |i: i32| Point3::new(0.01 * f64::from(i % 6), 0.01 * f64::from(i / 6), 1.0);
    (0..30).map(|i| (at(i), [i as u8, 200, 255 - i as u8])).collect()
}

fn rows(paint: impl Fn([u8; 3]) -> String) -> String {
    let row = |(i, (p, rgb)): (usize, (Point3<f64>, [u8; 3]))| {
        let x = if i == 9 { "nan".to_owned() } else { p.x.to_string() };
        format!("{x} {} {} {}\n", p.y, p.z, paint(rgb))
    };
    points().into_iter().enumerate().map(row).collect()
}

fn packed([r, g, b]: [u8; 3]) -> u32 {
    u32::from(r) << 16 | u32::from(g) << 8 | u32::from(b)
}

fn read(bytes: &[u8], format: Format) -> Result<RawScan, ScanError> {
    read_bytes(bytes, format, Path::new("scan"), &ReadOptions::default())
}

fn pcd(kind: char, data: &str) -> String {
    format!(
        "VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F {kind}\nCOUNT 1 1 1 1\nWIDTH 30\n\
         HEIGHT 1\nPOINTS 30\nDATA {data}\n"
    )
}

#[test]
fn every_format_gives_each_point_its_colour() {
    let spaced = |[r, g, b]: [u8; 3]| format!("{r} {g} {b}");
    let number = |rgb| packed(rgb).to_string();
    let float = |rgb| format!("{:e}", f32::from_bits(packed(rgb)));
    let ply = "ply\nformat ascii 1.0\nelement vertex 30\nproperty float x\nproperty float y\n\
               property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
               end_header\n";
    let mut binary = pcd('F', "binary").into_bytes();
    for (i, (p, rgb)) in points().into_iter().enumerate() {
        let x = if i == 9 { f64::NAN } else { p.x };
        [x, p.y, p.z].iter().for_each(|v| binary.extend((*v as f32).to_le_bytes()));
        // With the alpha of an opaque point these bits are no number.
        binary.extend((packed(rgb) | 0xff00_0000).to_le_bytes());
    }
    for (what, bytes, format) in [
        ("names", format!("x y z r g b\n{}", rows(spaced)).into_bytes(), Format::Text),
        ("no names", rows(spaced).into_bytes(), Format::Text),
        ("numbers", (pcd('U', "ascii") + &rows(number)).into_bytes(), Format::Pcd),
        ("floats", (pcd('F', "ascii") + &rows(float)).into_bytes(), Format::Pcd),
        ("binary", binary, Format::Pcd),
        ("polygons", (ply.to_owned() + &rows(spaced)).into_bytes(), Format::Ply),
    ] {
        let raw = read(&bytes, format).unwrap_or_else(|error| panic!("{what}: {error}"));
        let colours = raw.colours.as_ref().unwrap_or_else(|| panic!("{what}: no colours"));
        assert_eq!((raw.points.len(), colours.len()), (29, 29), "{what}");
        let all = points();
        for (point, colour) in raw.points.iter().zip(colours) {
            let of =
                all.iter().min_by(|a, b| (a.0 - point).norm().total_cmp(&(b.0 - point).norm()));
            assert_eq!(*colour, of.expect("points").1, "{what}: {point}");
        }
        // They stay with them when a part is cut out.
        let (placed, _) = place(&raw, &Placement::SensorPose(Isometry3::identity()));
        let part: CropBox = "-1,-1,0,0.025,1,2".parse().expect("a box");
        let view = &placed.crop(&part).expect("points").views[0];
        let colours = view.colours.as_ref().expect("colours");
        assert!(colours.len() < 20 && colours.len() == view.points.len());
        assert!(view.points.iter().zip(colours).all(|(p, c)| {
            let i = (p.x / 0.01).round() as u8 + 6 * (p.y / 0.01).round() as u8;
            *c == [i, 200, 255 - i]
        }));
    }
}

#[test]
fn what_is_no_colour_is_none() {
    let raw = read(rows(|_| String::new()).as_bytes(), Format::Text).expect("points");
    assert!(raw.colours.is_none());
    let odd = format!("x y z r g b\n{}", rows(|_| "300 0 0".into()));
    assert!(read(odd.as_bytes(), Format::Text).expect("points").colours.is_none());
}
