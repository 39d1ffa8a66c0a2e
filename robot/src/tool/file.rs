//! A tool as it stands in files: the keys that its shape has, and no others.

use nalgebra::Vector3;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::error::ToolError;
use super::footprint::{Camera, Footprint, Nozzle, Roller};
use super::tool::Tool;

/// All keys of all shapes. Those of a rectangle stand in their old order, so that a plan's tool is
/// written as it was.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolFile {
    /// For people.
    name: String,
    /// `rectangle` (a pad; where nothing is said), `disc` (a round pad, its heading free), `roller`
    /// (rolls along its travel alone), `nozzle` (sprays from afar) or `camera` (looks from afar).
    #[serde(default, skip_serializing_if = "Shape::is_rectangle")]
    shape: Shape,
    /// Of a rectangle, roller or camera: across the travel, the contact frame's y; of a camera that
    /// of its body. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    length: Option<f64>,
    /// Of a rectangle, roller or camera: along the travel, the contact frame's x; of a roller that
    /// of the strip that touches, of a camera that of its body. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    width: Option<f64>,
    /// Of a disc; of a roller; of a nozzle's body. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    radius: Option<f64>,
    /// Of all but a roller: height of the body, from the contact frame's plane back towards the
    /// arm. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    thickness: Option<f64>,
    /// The contact frame's origin in the arm's tip frame: the pad's centre, the roller's line of
    /// contact, the nozzle's mouth, the lens. \[m\]
    centre: [f64; 3],
    /// The tip frame's axis that points into the surface.
    approach: [f64; 3],
    /// The tip frame's axis along the long side; a disc and a nozzle need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    across: Option<[f64; 3]>,
    /// Distance kept between the contact frame's origin and the surface, along the normal; below 0
    /// a pad is pressed in so far. \[m\]
    stand_off: f64,
    /// Of what touches: how far its soft body may be pressed in, along its axis; a third of the
    /// thickness, or of a roller's radius, where nothing is said. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    press_max: Option<f64>,
    /// Of a rectangle or roller: whether a heading and its opposite are the same contact; a
    /// roller's are where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    symmetric: Option<bool>,
    /// Of what touches: a point is swept within this distance of the plane `stand_off` ahead. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reach_normal: Option<f64>,
    /// A point is swept if its normal is within this angle of the pad's, or of the ray to the
    /// nozzle or camera. \[rad\]
    reach_angle: f64,
    /// Of a roller: the greatest angle between its travel and its own direction; 0.05 where nothing
    /// is said. \[rad\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    slip_max: Option<f64>,
    /// Of a nozzle or camera: nearest and farthest along its axis that it works. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distance: Option<[f64; 2]>,
    /// Of a nozzle: half of the opening angle of what it sprays, which falls off from the axis as a
    /// parabola. \[rad\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    cone: Option<f64>,
    /// Of a nozzle: what it sprays, of that what stays on. \[m³/s\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rate: Option<f64>,
    /// Of a nozzle: the least and the most that is to lie on a point in the end. \[m\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deposit: Option<[f64; 2]>,
    /// Of a camera: its full opening angles across and along. \[rad\]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    field_of_view: Option<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Shape {
    #[default]
    Rectangle,
    Disc,
    Roller,
    Nozzle,
    Camera,
}

impl Shape {
    fn is_rectangle(&self) -> bool {
        *self == Self::Rectangle
    }

    fn name(self) -> &'static str {
        match self {
            Self::Rectangle => "rectangle",
            Self::Disc => "disc",
            Self::Roller => "roller",
            Self::Nozzle => "nozzle",
            Self::Camera => "camera",
        }
    }

    /// The keys that only some shapes have, of this one.
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Rectangle => {
                &["length", "width", "thickness", "press_max", "symmetric", "reach_normal"]
            }
            Self::Disc => &["radius", "thickness", "press_max", "reach_normal"],
            Self::Roller => {
                &["length", "width", "radius", "press_max", "symmetric", "reach_normal", "slip_max"]
            }
            Self::Nozzle => &["radius", "thickness", "distance", "cone", "rate", "deposit"],
            Self::Camera => &["length", "width", "thickness", "distance", "field_of_view"],
        }
    }
}

/// Travel of a roller that is not said may be so far from straight ahead. \[rad\]
const SLIP_MAX: f64 = 0.05;
/// Share of a pad's thickness, or of a roller's radius, that it may be pressed in where nothing is
/// said.
const PRESS_SHARE: f64 = 1.0 / 3.0;

impl ToolFile {
    /// The keys that only some shapes have, and whether they are there.
    fn said(&self) -> [(&'static str, bool); 13] {
        [
            ("length", self.length.is_some()),
            ("width", self.width.is_some()),
            ("radius", self.radius.is_some()),
            ("thickness", self.thickness.is_some()),
            ("press_max", self.press_max.is_some()),
            ("symmetric", self.symmetric.is_some()),
            ("reach_normal", self.reach_normal.is_some()),
            ("slip_max", self.slip_max.is_some()),
            ("distance", self.distance.is_some()),
            ("cone", self.cone.is_some()),
            ("rate", self.rate.is_some()),
            ("deposit", self.deposit.is_some()),
            ("field_of_view", self.field_of_view.is_some()),
        ]
    }

    /// The tool, if there can be one.
    fn tool(self) -> Result<Tool, ToolError> {
        let shape = self.shape.name();
        let keys = self.shape.keys();
        let foreign = self.said().into_iter().find(|(field, is)| *is && !keys.contains(field));
        if let Some((field, _)) = foreign {
            return Err(ToolError::Foreign { field, shape });
        }
        let need = |field, value: Option<f64>| value.ok_or(ToolError::Missing { field, shape });
        let pair =
            |field, value: Option<[f64; 2]>| value.ok_or(ToolError::Missing { field, shape });
        let length = || need("length", self.length);
        let width = || need("width", self.width);
        let radius = || need("radius", self.radius);
        let thickness = || need("thickness", self.thickness);
        let distance = || pair("distance", self.distance);
        let (sides, thickness, footprint) = match self.shape {
            Shape::Rectangle => ([length()?, width()?], thickness()?, Footprint::Rectangle),
            Shape::Disc => ([2.0 * radius()?; 2], thickness()?, Footprint::Disc),
            Shape::Roller => {
                let slip_max = self.slip_max.unwrap_or(SLIP_MAX);
                let roller = Roller { radius: radius()?, slip_max };
                ([length()?, width()?], 2.0 * radius()?, Footprint::Roller(roller))
            }
            Shape::Nozzle => {
                let nozzle = Nozzle {
                    distance: distance()?,
                    cone: need("cone", self.cone)?,
                    rate: need("rate", self.rate)?,
                    deposit: pair("deposit", self.deposit)?,
                };
                ([2.0 * radius()?; 2], thickness()?, Footprint::Nozzle(nozzle))
            }
            Shape::Camera => {
                let field_of_view = pair("field_of_view", self.field_of_view)?;
                let camera = Camera { distance: distance()?, field_of_view };
                ([length()?, width()?], thickness()?, Footprint::Camera(camera))
            }
        };
        let is_round = matches!(self.shape, Shape::Disc | Shape::Nozzle);
        let symmetric = match (self.shape, self.symmetric) {
            (Shape::Rectangle, said) => {
                said.ok_or(ToolError::Missing { field: "symmetric", shape })?
            }
            (_, said) => said.unwrap_or(true),
        };
        let press_max = match self.shape {
            Shape::Nozzle | Shape::Camera => 0.0,
            Shape::Roller => self.press_max.unwrap_or(PRESS_SHARE * 0.5 * thickness),
            Shape::Rectangle | Shape::Disc => self.press_max.unwrap_or(thickness / 3.0),
        };
        let reach_normal = match footprint {
            Footprint::Nozzle(Nozzle { distance: [near, far], .. })
            | Footprint::Camera(Camera { distance: [near, far], .. }) => {
                (self.stand_off - near).max(far - self.stand_off)
            }
            _ => need("reach_normal", self.reach_normal)?,
        };
        let across = match self.across {
            None if is_round => beside(&self.approach),
            None => return Err(ToolError::Missing { field: "across", shape }),
            Some(across) => across,
        };
        let tool = Tool {
            name: self.name,
            length: sides[0],
            width: sides[1],
            thickness,
            centre: self.centre,
            approach: self.approach,
            across,
            stand_off: self.stand_off,
            press_max,
            symmetric,
            reach_normal,
            reach_angle: self.reach_angle,
            footprint,
        };
        tool.check().map(|()| tool)
    }
}

impl From<&Tool> for ToolFile {
    fn from(tool: &Tool) -> Self {
        let some = |is: bool, value: f64| is.then_some(value);
        let shape = match tool.footprint {
            Footprint::Rectangle => Shape::Rectangle,
            Footprint::Disc => Shape::Disc,
            Footprint::Roller(_) => Shape::Roller,
            Footprint::Nozzle(_) => Shape::Nozzle,
            Footprint::Camera(_) => Shape::Camera,
        };
        let has = |key: &str| shape.keys().contains(&key);
        let mut file = Self {
            name: tool.name.clone(),
            shape,
            length: some(has("length"), tool.length),
            width: some(has("width"), tool.width),
            radius: some(has("radius"), 0.5 * tool.width),
            thickness: some(has("thickness"), tool.thickness),
            centre: tool.centre,
            approach: tool.approach,
            across: Some(tool.across),
            stand_off: tool.stand_off,
            press_max: some(has("press_max"), tool.press_max),
            symmetric: has("symmetric").then_some(tool.symmetric),
            reach_normal: some(has("reach_normal"), tool.reach_normal),
            reach_angle: tool.reach_angle,
            ..Self::default()
        };
        match tool.footprint {
            Footprint::Rectangle | Footprint::Disc => {}
            Footprint::Roller(Roller { radius, slip_max }) => {
                (file.radius, file.slip_max) = (Some(radius), Some(slip_max));
            }
            Footprint::Nozzle(Nozzle { distance, cone, rate, deposit }) => {
                (file.distance, file.cone) = (Some(distance), Some(cone));
                (file.rate, file.deposit) = (Some(rate), Some(deposit));
            }
            Footprint::Camera(Camera { distance, field_of_view }) => {
                (file.distance, file.field_of_view) = (Some(distance), Some(field_of_view));
            }
        }
        file
    }
}

impl Serialize for Tool {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        ToolFile::from(self).serialize(out)
    }
}

impl<'de> Deserialize<'de> for Tool {
    fn deserialize<D: Deserializer<'de>>(input: D) -> Result<Self, D::Error> {
        ToolFile::deserialize(input)?.tool().map_err(D::Error::custom)
    }
}

/// An axis across another one.
fn beside(axis: &[f64; 3]) -> [f64; 3] {
    let axis = Vector3::from(*axis);
    Vector3::ith(axis.iamin(), 1.0).cross(&axis).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_tells_only_of_tools_that_can_be() {
        let text = serde_json::to_string(&Tool::default()).expect("numbers");
        assert_eq!(serde_json::from_str::<Tool>(&text).expect("a tool"), Tool::default());
        let thin = text.replace("\"thickness\":0.03", "\"thickness\":-0.03");
        let said = serde_json::from_str::<Tool>(&thin).expect_err("thinner than nothing");
        assert!(said.to_string().contains("thickness is -0.03 m"), "{said}");
        assert!(serde_json::from_str::<Tool>(&text.replace("width", "breadth")).is_err());
    }
}
