//! A pad that leaves its line or the surface shows in the figures.

use nalgebra::Vector3;

use crate::stage::{judge, moved, on_the_line, pad, spoilt, stage};

#[test]
fn a_pad_beside_its_line_shows_in_the_deviation() {
    let s = stage();
    let k = on_the_line(&s.bang);
    let along = s.bang.line(k + 1).unwrap() - s.bang.line(k - 1).unwrap();
    let beside =
        along.cross(&(pad(&s.bang.knots[k].q).rotation * Vector3::z())).normalize() * 0.003;
    let off = spoilt(&s.bang, |knots| knots[k].q = moved(knots[k].q, beside));
    let (sound, off) = (judge(&s.bang, &s.scene), judge(&off, &s.scene));
    assert!(sound.line_deviation_max_m < 2e-4, "{}", sound.line_deviation_max_m);
    assert!((off.line_deviation_max_m - 0.003).abs() < 1e-4, "{}", off.line_deviation_max_m);
}

#[test]
fn a_pad_off_the_surface_shows_in_distance_and_coverage() {
    let s = stage();
    let lifted = spoilt(&s.bang, |knots| {
        for knot in &mut knots[80..180] {
            assert!(knot.line.is_some());
            knot.q = moved(knot.q, pad(&knot.q).rotation * Vector3::z() * -0.02);
        }
    });
    let (sound, lifted) = (judge(&s.bang, &s.scene), judge(&lifted, &s.scene));
    assert!(sound.scan_distance_max_m < 0.006, "{}", sound.scan_distance_max_m);
    for distance in [lifted.scan_distance_p95_m, lifted.scan_distance_max_m] {
        // From up to 4 mm below the surface.
        assert!((0.013..0.026).contains(&distance), "{distance}");
    }
    assert!((lifted.line_deviation_max_m - 0.02).abs() < 1e-3, "{}", lifted.line_deviation_max_m);
    for (before, now) in [
        (sound.coverage_all, lifted.coverage_all),
        (sound.coverage_reachable, lifted.coverage_reachable),
    ] {
        assert!(before > 0.2 && now < before - 0.05, "{before} {now}");
    }
}
