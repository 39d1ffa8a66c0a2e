//! The data as the page's script reads them: numbers as little-endian bytes in base64, points of a
//! cloud as 16-bit shares of their box.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use crate::data::{Body, Cloud, LineSet, Look, Motion, Paint, Place, ReportData, Series, Shape};

/// Most points shown of one cloud; more neither show more nor load well.
const MAX_POINTS: usize = 60_000;

/// How far aside of the way ahead the page is seen from at first. \[rad\]
const ASIDE: f64 = 1.15;

/// The whole page's data.
pub(super) fn value(data: &ReportData) -> Value {
    json!({
        "joints": data.joints.iter().map(|joint| json!({
            "name": joint.name,
            "unit": joint.unit,
            "limits": joint.limits.map(|(low, high)| [low, high]),
        })).collect::<Vec<_>>(),
        "bodies": data.bodies.iter().map(body).collect::<Vec<_>>(),
        "shapes": data.shapes.iter().map(shape).collect::<Vec<_>>(),
        "pad": data.pad.map(|pad| json!({ "body": pad.body, "centre": at(&pad.centre) })),
        "clouds": data.clouds.iter().filter(|c| !c.points.is_empty()).map(cloud).collect::<Vec<_>>(),
        "spacing": data.spacing,
        "lines": data.lines.iter().filter(|l| !l.lines.is_empty()).map(line_set).collect::<Vec<_>>(),
        "places": data.places.iter().map(|group| json!({
            "name": group.name,
            "detail": group.detail,
            "items": group.items.iter().map(place).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "plans": data.plans.iter().map(motion).collect::<Vec<_>>(),
        "measured": data.measured.iter().map(motion).collect::<Vec<_>>(),
        "focus": focus(data),
    })
}

fn at(point: &Point3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|i| point[i])
}

fn base64(bytes: impl Iterator<Item = u8>) -> String {
    STANDARD.encode(bytes.collect::<Vec<u8>>())
}

fn floats(values: impl IntoIterator<Item = f64>) -> String {
    base64(values.into_iter().flat_map(|v| (v as f32).to_le_bytes()))
}

fn coordinates(points: &[Point3<f64>]) -> String {
    floats(points.iter().flat_map(at))
}

fn body(body: &Body) -> Value {
    json!({
        "parent": body.parent,
        "rest": body.rest.to_homogeneous().as_slice(),
        "axis": [body.axis.x, body.axis.y, body.axis.z],
        "slides": body.slides,
        "joint": body.joint,
        "factor": body.factor,
        "offset": body.offset,
    })
}

fn shape(shape: &Shape) -> Value {
    let look = match shape.look {
        Look::Robot => "robot",
        Look::Pad => "pad",
        Look::Guessed => "guessed",
        Look::Obstacle => "obstacle",
        Look::Ground => "ground",
    };
    json!({
        "name": shape.name,
        "look": look,
        "body": shape.body,
        "vertices": coordinates(&shape.vertices),
        "triangles": base64(shape.triangles.iter().flatten().flat_map(|c| c.to_le_bytes())),
    })
}

fn cloud(cloud: &Cloud) -> Value {
    let stride = cloud.points.len().div_ceil(MAX_POINTS).max(1);
    let (low, high) = bounds(&cloud.points).unwrap_or_default();
    let size = high - low;
    let share = |p: &Point3<f64>, i: usize| {
        let share = if size[i] > 0.0 { (p[i] - low[i]) / size[i] } else { 0.0 };
        (share * f64::from(u16::MAX)).round() as u16
    };
    let shares = cloud.points.iter().step_by(stride);
    let shares = shares.flat_map(|p| [0, 1, 2].map(|i| share(p, i))).flat_map(u16::to_le_bytes);
    let paint = match cloud.paint {
        Paint::Swept => json!("swept"),
        Paint::Left => json!("left"),
        Paint::Unseen => json!("unseen"),
        Paint::Around => json!("around"),
        Paint::Numbered(n) => json!(n),
    };
    let name = match stride {
        1 => cloud.name.clone(),
        n => format!("{} (1 of {n})", cloud.name),
    };
    json!({
        "name": name,
        "paint": paint,
        "low": at(&low),
        "size": [size.x, size.y, size.z],
        "shares": base64(shares),
        "shown": cloud.shown,
    })
}

fn line_set(set: &LineSet) -> Value {
    let lines: Vec<String> = set.lines.iter().map(|line| coordinates(line)).collect();
    json!({ "name": set.name, "shown": set.shown, "lines": lines })
}

fn place(place: &Place) -> Value {
    json!({
        "label": place.label,
        "at": at(&place.at),
        "radius": place.radius,
        "normal": place.normal.map(|n| [n.x, n.y, n.z]),
    })
}

/// Joints knot by knot, so that one knot's are together.
fn by_knot(joints: &[Vec<f64>], knots: usize) -> String {
    floats((0..knots).flat_map(|k| joints.iter().map(move |list| list[k])))
}

fn motion(motion: &Motion) -> Value {
    let knots = motion.times.len();
    let contact = base64(motion.contact.iter().map(|c| u8::from(*c)));
    json!({
        "name": motion.name,
        "starts_at": motion.starts_at,
        "times": floats(motion.times.iter().copied()),
        "q": by_knot(&motion.joints, knots),
        "v": (!motion.velocities.is_empty()).then(|| by_knot(&motion.velocities, knots)),
        "contact": (!motion.contact.is_empty()).then_some(contact),
        "stops": motion.stops,
        "series": motion.series.iter().map(series).collect::<Vec<_>>(),
        "probes": motion.probes.iter()
            .map(|probe| json!({ "time": probe.time, "pad": at(&probe.pad) }))
            .collect::<Vec<_>>(),
    })
}

fn series(series: &Series) -> Value {
    json!({
        "name": series.name,
        "unit": series.unit,
        "times": floats(series.times.iter().copied()),
        "values": floats(series.values.iter().copied()),
        "most": series.most,
    })
}

fn bounds<'a>(
    points: impl IntoIterator<Item = &'a Point3<f64>>,
) -> Option<(Point3<f64>, Point3<f64>)> {
    points.into_iter().fold(None, |box_, p| {
        let (low, high) = box_.unwrap_or((*p, *p));
        Some((low.inf(p), high.sup(p)))
    })
}

/// The ball that the page opens on, and the side that it is seen from: what is to be swept and the
/// arm's shoulder; without that, where the pad goes; without either, whatever there is. `None`: there
/// is nothing in space.
fn focus(data: &ReportData) -> Option<Value> {
    let surface = |c: &&Cloud| !matches!(c.paint, Paint::Around | Paint::Unseen);
    let surface: Vec<_> =
        data.clouds.iter().filter(surface).flat_map(|c| &c.points).copied().collect();
    let swept = bounds(&surface);
    let shoulder = data.bodies.first().map(|body| Point3::from(body.rest.translation.vector));
    let pads: Vec<_> = data.plans.iter().flat_map(|m| &m.probes).map(|probe| probe.pad).collect();
    let everything = || data.clouds.iter().flat_map(|c| &c.points);
    let lines = || data.lines.iter().flat_map(|l| &l.lines).flatten();
    let (low, high) = match (swept, shoulder) {
        (Some(_), shoulder) => bounds(surface.iter().chain(&shoulder))?,
        (None, Some(shoulder)) if !pads.is_empty() => bounds(pads.iter().chain([&shoulder]))?,
        (None, Some(shoulder)) => {
            let reach = Vector3::repeat(0.7);
            (shoulder - reach, shoulder + reach)
        }
        (None, None) => bounds(everything()).or_else(|| bounds(lines()))?,
    };
    let middle = nalgebra::center(&low, &high);
    // Aslant from ahead, on the arm's side.
    let ahead = swept.map_or(0.0, |(low, high)| {
        let surface = nalgebra::center(&low, &high);
        surface.y.atan2(surface.x)
    });
    let side = if shoulder.is_some_and(|s| s.y > 0.0) { 1.0 } else { -1.0 };
    Some(json!({
        "at": at(&middle),
        "radius": (0.5 * (high - low).norm()).max(0.05),
        "turn": if data.bodies.is_empty() { -2.2 } else { ahead + side * ASIDE },
    }))
}
