//! Files as programs really write them: read right, and what had to be guessed is told.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Vector3};
use nullsweep_surface::scan::{self, Format, Rest, ScanWarning, below_support};
use nullsweep_surface::{Placement, RawScan, ReadOptions, ScanError};

/// A bent sheet of 400 points: every coordinate differs from every other and from any index.
fn sheet() -> Vec<Point3<f64>> {
    let at = |i: usize| 0.0131 * i as f64;
    let z = |i: usize| 1.2 + 0.03 * (0.4 * at(i % 20) * 20.0).sin();
    (0..400).map(|i| Point3::new(at(i % 20) - 0.11, at(i / 20) - 0.07, z(i))).collect()
}

fn read(text: impl AsRef<[u8]>, name: &str) -> Result<RawScan, ScanError> {
    let format = Format::detect(Path::new(name), text.as_ref()).expect("a known format");
    scan::read_bytes(text.as_ref(), format, Path::new(name), &ReadOptions::default())
}

/// The sheet as a table: what stands before the rows, and each row by a function.
fn table(head: &str, row: impl Fn(usize, &Point3<f64>) -> String) -> String {
    let rows = sheet().iter().enumerate().map(|(i, p)| row(i, p) + "\n").collect::<String>();
    head.to_owned() + &rows
}

/// That a table holds the sheet without normals, and what was told of it.
fn told(text: &str) -> Vec<ScanWarning> {
    let raw = read(text, "sheet.csv").unwrap_or_else(|e| panic!("{e}\n{text:.200}"));
    assert_eq!(raw.points.len(), 400, "{text:.200}");
    for (a, b) in raw.points.iter().zip(&sheet()) {
        assert!((a - b).norm() < 1e-5, "{a} is not {b}: {text:.200}");
    }
    assert_eq!(raw.normals, None, "{text:.200}");
    raw.warnings
}

#[test]
fn the_names_of_the_columns_decide() {
    let xyz = |p: &Point3<f64>| format!("{:.6},{:.6},{:.6}", p.x, p.y, p.z);
    let blank = |p: &Point3<f64>| format!("{:.6} {:.6} {:.6}", p.x, p.y, p.z);
    for text in [
        table("x,y,z\n", |_, p| xyz(p)),
        table("//X Y Z R G B\n", |_, p| blank(p) + " 130 95 60"),
        table("# x y z r g b\n", |_, p| blank(p) + " 0.6 0.8 0.0"),
        table("# made by hand\n# Columns: x, y, z\n", |_, p| blank(p)),
        table(",x,y,z\n", |i, p| format!("{},{}", 0.0005 * i as f64, xyz(p))),
        table("\tx\ty\tz\n", |i, p| format!("{i}\t{}", xyz(p).replace(',', "\t"))),
        table("X [m],Y [m],Z [m],R,G,B\n", |_, p| xyz(p) + ",0.51,0.37,0.24"),
        table("\"Points:0\",\"Points:1\",\"Points:2\",\"I\"\n", |_, p| xyz(p) + ",5"),
        table("\"I\",\"Points_2\",\"Points_1\",\"Points_0\"\n", |i, p| {
            format!("{i},{:.6},{:.6},{:.6}", p.z, p.y, p.x)
        }),
        table("x;y;z\n", |_, p| xyz(p).replace(',', ";").replace('.', ",")),
        table("label,x,y,z\n", |_, p| format!("\"chair, red\",{}", xyz(p))),
    ] {
        assert_eq!(told(&text), [], "{text:.200}");
    }
    let mm = table("X [mm] Y [mm] Z [mm]\n", |_, p| blank(&(p * 1000.0)));
    assert_eq!(told(&mm), [ScanWarning::Unit { unit: "mm".into(), factor: 0.001 }]);
    let options = ReadOptions { scale: 0.001, ..ReadOptions::default() };
    let raw = scan::read_bytes(mm.as_bytes(), Format::Text, Path::new("mm"), &options).unwrap();
    assert!((raw.points[7] - sheet()[7]).norm() < 1e-5, "scaled once, though asked for too");
    assert!(matches!(raw.warnings[..], [ScanWarning::UnitOverruled { .. }]));

    let error = read(table("lat,lon,alt\n", |_, p| xyz(p)), "a.csv").unwrap_err().to_string();
    assert!(error.starts_with("a.csv: line 1: no columns x, y, z"), "{error}");
    let error = read("x,y,z\n", "a.csv").unwrap_err().to_string();
    assert_eq!(error, "a.csv: line 1: no row of numbers follows \"x,y,z\"");
    let doubt = table("x y z\n", |i, p| format!("{} {}", 0.1 * i as f64, blank(p)));
    let error = read(doubt, "a.txt").unwrap_err().to_string();
    assert!(error.contains("is it x or an index?"), "{error}");
}

#[test]
fn what_is_guessed_without_names_is_told() {
    let row = |p: &Point3<f64>| format!("{:.6} {:.6} {:.6}", p.x, p.y, p.z);
    let unnamed = |rest| ScanWarning::Unnamed { first: 1, rest };
    assert_eq!(told(&table("", |_, p| row(p))), []);
    for colour in ["131 95 60", "0.51 0.37 0.24", "0 0 0"] {
        let text = table("", |_, p| format!("{} {colour}", row(p)));
        assert_eq!(told(&text), [unnamed(Rest::Colour)], "{colour}");
    }
    let text =
        table("", |i, p| format!("{} {}", row(p), if i % 9 == 0 { "0 1 0" } else { "0.5 0 0" }));
    assert_eq!(told(&text), [unnamed(Rest::Colour)]);
    let text = table("400\n", |_, p| row(p) + " -1200 130 95 60");
    assert_eq!(told(&text), [unnamed(Rest::Ignored)]);
    let text = table("512\n", |_, p| row(p));
    assert_eq!(told(&text), [ScanWarning::CountDiffers { announced: 512, found: 400 }]);
    let text = table("", |i, p| format!("{} {}", i + 1, row(p)));
    assert_eq!(told(&text), [ScanWarning::IndexColumn]);
    let text = table("Chair scan\n", |_, p| row(p));
    assert!(matches!(told(&text)[..], [ScanWarning::LineSkipped { .. }]));

    let text = table("", |_, p| row(p) + " 0.60 0.0 -0.80");
    let raw = read(&text, "normals.xyz").unwrap();
    let normals = raw.normals.expect("unit vectors are normals");
    assert!((normals[0].into_inner() - Vector3::new(0.6, 0.0, -0.8)).norm() < 1e-9);
    assert_eq!(raw.warnings, [unnamed(Rest::Normals)]);
}

#[test]
fn a_cell_without_a_value_is_no_point_and_moves_no_other() {
    for (head, nothing) in [
        ("x,y,z,c\n", ",,,0.3"),
        ("x,y,z,c\n", "0.1,0.2,,0.3"),
        ("x,y,z,c\n", "NaN,NaN,NaN,0.3"),
        ("x,y,z,c\n", "NA,NA,NA,NA"),
        ("x,y,z,c\n", "0.1,0.2,null,0.3"),
        ("", ",,,0"),
        ("", "0.1,-1.#IND,0.3,0"),
    ] {
        let text = table(head, |i, p| {
            let row = format!("{:.6},{:.6},{:.6},0.9", p.x, p.y, p.z);
            if i % 2 == 0 { format!("{nothing}\n{row}") } else { row }
        });
        let warnings = told(&text);
        assert!(warnings.contains(&ScanWarning::NonFinite { dropped: 200 }), "{warnings:?}");
    }
    let short = table("x y z c\n", |i, p| {
        format!("{} {} {}{}", p.x, p.y, p.z, if i == 9 { "" } else { " 0.9" })
    });
    let error = read(short, "a.xyz").unwrap_err().to_string();
    assert!(error.starts_with("a.xyz: line 11: 3 numbers where 4"), "{error}");
    let zeros = table("x,y,z\n", |i, p| {
        let row = format!("{:.6},{:.6},{:.6}", p.x, p.y, p.z);
        if i % 2 == 0 { format!("0,0,0\n{row}") } else { row }
    });
    assert_eq!(told(&zeros), [ScanWarning::AtOrigin { dropped: 200 }]);
}

#[test]
fn one_stray_point_moves_nothing() {
    let sound = read(table("", |_, p| format!("{} {} {}", p.x, p.y, p.z)), "a.xyz").unwrap();
    let up = Placement::Up { up: Vector3::z_axis(), support_height: 0.45 };
    for stray in ["0.1 0.1 -2.0", "1e6 0 0", "0 -1e300 0"] {
        let text = table(&format!("{stray}\n"), |_, p| format!("{} {} {}", p.x, p.y, p.z));
        let raw = read(text, "a.xyz").unwrap();
        assert!(matches!(raw.warnings[..], [ScanWarning::Stray { dropped: 1, .. }]), "{stray}");
        assert_eq!(scan::place(&raw, &up), scan::place(&sound, &up), "{stray}");
    }
    // One that is not far enough to be left out lifts nothing all the same.
    let mut raw = sound.clone();
    raw.points.push(Point3::new(0.0, 0.0, 1.08));
    assert_eq!(below_support(&raw, &up), 1);
    let (_, with) = scan::place(&raw, &up);
    let (_, without) = scan::place(&sound, &up);
    assert!((with.translation.z - without.translation.z).abs() < 1e-12);
}

#[test]
fn meshes_are_read_as_exporters_write_them() {
    let corner =
        |i: usize| [0.3 * (i & 1) as f32, 0.2 * (i >> 1 & 1) as f32, 0.1 * (i >> 2) as f32];
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut ascii = String::from("SOLID box\n");
    let mut binary = b"solid by an exporter".to_vec();
    binary.resize(80, 0);
    binary.extend(12u32.to_le_bytes());
    let mut obj = String::new();
    for [x, y, z] in (0..8).map(corner) {
        obj += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c] in quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]) {
        ascii += "FACET NORMAL 0 0 1\nOUTER LOOP\n";
        binary.extend([0; 12]);
        for [x, y, z] in [a, b, c].map(corner) {
            ascii += &format!("VERTEX {x} {y} {z}\n");
            binary.extend([x, y, z].iter().flat_map(|v| v.to_le_bytes()));
        }
        ascii += "ENDLOOP\nENDFACET\n";
        binary.extend([0; 2]);
        obj += &format!("f {} {} \\\n{}\n", a + 1, b + 1, c + 1);
    }
    let sound = read(&binary, "box.stl").unwrap();
    assert_eq!(sound.warnings, []);
    let same = |bytes: &[u8], name: &str| {
        let raw = read(bytes, name).unwrap_or_else(|e| panic!("{e}"));
        let same = raw.points.len() == sound.points.len()
            && raw.points.iter().zip(&sound.points).all(|(a, b)| (a - b).norm() < 1e-6)
            && raw.normals.as_ref().is_some_and(|n| Some(n) == sound.normals.as_ref());
        assert!(same, "{name}: {:?}", raw.warnings);
        raw.warnings
    };
    binary.push(0);
    assert!(matches!(same(&binary, "box.stl")[..], [ScanWarning::TrailingData { .. }]));
    assert_eq!(same(ascii.as_bytes(), "box.stl"), [ScanWarning::NoEnd]);
    let latin = [b"solid Stuhl f\xFCr\n".as_slice(), ascii.as_bytes(), b"endsolid\n"].concat();
    assert!(matches!(same(&latin, "box.stl")[..], [ScanWarning::NotUtf8 { .. }]));
    assert_eq!(same(obj.as_bytes(), "box.obj"), []);
    let latin = [b"# f\xFCr\n".as_slice(), obj.as_bytes()].concat();
    assert!(matches!(same(&latin, "box.obj")[..], [ScanWarning::NotUtf8 { .. }]));
    let cut = &ascii[..ascii.len() - "ENDLOOP\nENDFACET\n".len()];
    assert!(read(cut, "box.stl").unwrap_err().to_string().contains("within a facet"));
}

#[test]
fn headers_and_lines_that_others_write_are_read() {
    let head =
        "VERSION 0.7\nFIELDS z y x\nSIZE 4 4 4\nTYPE F F F\nWIDTH 400\nHEIGHT 1\nDATA ascii\n";
    let pcd = table(head, |_, p| format!("{} {} {}", p.z, p.y, p.x));
    let raw = read(&pcd, "a.pcd").unwrap();
    assert_eq!(raw.points, sheet());
    assert_eq!(raw.warnings, [ScanWarning::Inferred { key: "POINTS", value: 400 }]);
    let pcd = pcd.replace("WIDTH 400\nHEIGHT 1", "POINTS 400");
    assert_eq!(read(pcd, "a.pcd").unwrap().points, sheet());

    let ply = b"ply\nformat ascii 1.0\ncomment f\xFCr\nelement vertex 400\nproperty uchar red\n\
                property double y\nproperty float z\nproperty float x\nend_header\n";
    let body =
        table("", |i, p| format!("7 {} \n{} {}{}", p.y, p.z, p.x, if i == 3 { "\n" } else { "" }));
    let more = read([ply.as_slice(), body.as_bytes(), b"\n9 9 9\n"].concat(), "a.ply").unwrap();
    let left = |warning: &ScanWarning| matches!(warning, ScanWarning::TrailingData { .. });
    assert!(more.warnings.iter().any(left), "{:?}", more.warnings);
    let raw = read([ply.as_slice(), body.as_bytes()].concat(), "a.ply").unwrap();
    assert_eq!(raw.points, sheet());
    let place = scan::Place::Line(10);
    assert_eq!(raw.warnings, [ScanWarning::BrokenLines { place }]);
    // A value that is missing takes none from the next element.
    let lost = body.replacen("7 ", "", 1);
    assert!(read([ply.as_slice(), lost.as_bytes()].concat(), "a.ply").is_err());
}

#[test]
fn a_format_that_is_not_read_is_named_with_the_way_to_one_that_is() {
    let folder = tempfile::tempdir().unwrap();
    for (name, begins, format, command) in [
        ("a.3MF", "PK", "3MF", "assimp export"),
        ("b.fbx", "Kaydara FBX", "DAE, FBX or 3DS mesh", "assimp export"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, begins).unwrap();
        let error = scan::read(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains(&format!("{format} files are not read")), "{error}");
        assert!(error.contains(command) && error.contains(&path.display().to_string()), "{error}");
    }
}

/// The folder of reports, or `None` with the reason printed.
fn reports() -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/reports"));
    if !path.is_dir() {
        eprintln!("skipped: the test data {} is not here", path.display());
        return None;
    }
    Some(path.into())
}

#[test]
fn every_reported_file_is_read_right() {
    let Some(folder) = reports() else { return };
    let file = |name: &str| {
        let raw = scan::read(&folder.join(name), &ReadOptions::default());
        raw.unwrap_or_else(|e| panic!("{e}"))
    };
    let span = |raw: &RawScan| {
        let infinite = Vector3::repeat(f64::INFINITY);
        let grow = |(l, u): (Vector3<f64>, Vector3<f64>), p: &Point3<f64>| {
            (l.inf(&p.coords), u.sup(&p.coords))
        };
        let (l, u) = raw.points.iter().fold((infinite, -infinite), grow);
        u - l
    };
    // The same chair, thinned in several ways: 0.57 × 0.77 × 0.50 m.
    for (name, told) in [
        ("xyz_rgb.xyz", 1),
        ("xyz_rgb_comment_header.asc", 0),
        ("empty_z.csv", 1),
        ("empty_cells.csv", 1),
        ("index_column.csv", 0),
        ("units_in_header.csv", 0),
        ("count_line.pts", 1),
        ("quoted_colon_header.csv", 0),
        ("chair_outlier_1e6.pcd", 1),
        ("pcd_nopoints.pcd", 1),
        ("broken_lines_ascii.ply", 1),
    ] {
        let raw = file(name);
        let off = span(&raw) - Vector3::new(0.57, 0.76, 0.49);
        assert!(off.amax() < 0.03, "{name}: spans {:?}", span(&raw));
        assert_eq!((raw.warnings.len(), raw.normals), (told, None), "{name}: {:?}", raw.warnings);
    }
    let low = file("one_low_outlier.xyz");
    assert!(matches!(low.warnings[..], [ScanWarning::Stray { dropped: 1, .. }]));
    assert!(span(&low).z < 0.25);
    let right = file("box_out.stl");
    assert_eq!(right.warnings, []);
    for name in ["box_inward.stl", "box_mixed.stl", "box_doublesided.stl"] {
        let raw = file(name);
        assert_eq!(raw.points.len(), right.points.len(), "{name}");
        assert!(!raw.warnings.is_empty(), "{name}");
        let middle =
            right.points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / right.points.len() as f64;
        let normals = raw.normals.expect("faces have normals");
        let outward =
            |(p, n): (&Point3<f64>, &nalgebra::UnitVector3<f64>)| (p.coords - middle).dot(n) > 0.0;
        assert!(raw.points.iter().zip(&normals).all(outward), "{name}");
    }
    for name in ["bin_tail.stl", "noend.stl", "latin1.stl", "latin1.obj", "cont.obj"] {
        let raw = file(name);
        assert!(raw.points.len() > 1000, "{name}: {} points", raw.points.len());
    }
}
