//! A robot in its surroundings, prepared for fast collision checks.

use nalgebra::{Point3, Vector3};
use nullsweep_robot::{Arm, JointVector, Robot, Tool};
use parry3d_f64::shape::SharedShape;

use crate::bodies::{Bodies, MAX_BODIES};
use crate::exact::{Exact, Scene, SceneObstacle, Shapes};
use crate::field::Field;
use crate::frame::Frame;
use crate::mesh::{MeshError, read_stl};
use crate::motion::Reach;
use crate::never::{self, Placed, Ranges, never_near};
use crate::pairs::{self, Excluded};
use crate::parts::{self, Part};
use crate::solid::{Hull, Solid};
use crate::spheres::SphereTree;
use crate::{CollisionError, Hit, Margins, Obstacle, ObstacleShape, Options};

/// The robot at one stance with its tool, scan and obstacles: immutable, shared between threads.
pub struct World {
    pub(crate) arm: Arm,
    pub(crate) bodies: Bodies,
    /// Shapes that move with the arm, from the tip to the base.
    pub(crate) moving: Vec<Moving>,
    /// Shapes that do not, and the obstacles.
    pub(crate) fixed: Vec<Fixed>,
    /// Pairs of moving shapes to check.
    pub(crate) pairs: Vec<(usize, usize)>,
    pub(crate) field: Field,
    pub(crate) reach: Reach,
    pub(crate) margins: Margins,
    pub(crate) contact: Contact,
    /// Where each joint may be asked about: beyond, dropped scan points may be in reach and dropped
    /// pairs near each other. \[rad\] or \[m\]
    pub(crate) ranges: Ranges,
    pub(crate) scene: Scene,
    excluded: Vec<Excluded>,
    notes: Vec<String>,
}

/// A shape that moves with the arm.
pub(crate) struct Moving {
    pub(crate) body: usize,
    /// Pose in the body frame.
    pub(crate) place: Frame,
    pub(crate) solid: Solid,
    pub(crate) shape: SharedShape,
    /// In the body frame.
    pub(crate) tree: SphereTree,
    /// Indices of the fixed shapes to check against.
    pub(crate) against: Vec<usize>,
    /// How scan points may touch it, if they may.
    pub(crate) touch: Option<Touch>,
}

/// How a shape that is rigid to the tip may touch the scan.
pub(crate) struct Touch {
    /// Margin to scan points outside the prism. \[m\]
    pub(crate) margin: f64,
    /// How deep a scan point of the prism may lie inside; infinite for the pad. \[m\]
    pub(crate) depth: f64,
    /// Boxes (contact frame) that hold all places outside the prism within the margin. \[m\]
    pub(crate) keep_out: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Their corners, in the body frame. \[m\]
    corners: Vec<Vector3<f64>>,
    /// The boxes as solids, and spheres that cover them, in the body frame; only for the pad.
    pub(crate) guards: Vec<(Frame, Solid)>,
    pub(crate) tree: SphereTree,
}

/// The contact prism.
pub(crate) struct Contact {
    /// Contact frame in the tip's body.
    pub(crate) frame: Frame,
    /// Bounds in the contact frame. \[m\]
    pub(crate) min: Vector3<f64>,
    pub(crate) max: Vector3<f64>,
}

/// A shape that stands still in the root frame.
pub(crate) struct Fixed {
    pub(crate) place: Frame,
    pub(crate) solid: Solid,
    pub(crate) shape: SharedShape,
    /// Axis-aligned bounds in the root frame. \[m\]
    pub(crate) min: Vector3<f64>,
    pub(crate) max: Vector3<f64>,
    /// Distance to keep. \[m\]
    pub(crate) margin: f64,
}

impl World {
    /// Prepares the checks of an arm with a tool among scan points and obstacles, both in the
    /// robot's root frame.
    pub fn new(
        robot: &Robot,
        arm: &Arm,
        tool: &Tool,
        scan_points: &[Point3<f64>],
        obstacles: &[Obstacle],
        options: &Options,
    ) -> Result<Self, CollisionError> {
        check_input(scan_points, &options.margins)?;
        let margins = options.margins;
        let bodies = Bodies::new(robot, arm)
            .map_err(|count| CollisionError::TooManyBodies { count, most: MAX_BODIES })?;
        let (parts, notes) = parts::collect(robot, arm, tool, options)?;
        let shapes = Shapes::new(robot, &parts);
        let pairs = pairs::find(robot, arm, &bodies, &parts, &shapes, options)?;

        let contact_in_tip = Frame::from(&tool.contact_in_tip());
        let half = 0.5 * Vector3::new(tool.width, tool.length, 0.0);
        let growth = Vector3::new(margins.contact_growth, margins.contact_growth, 0.0);
        let contact = Contact {
            frame: bodies.tip.then(&contact_in_tip),
            min: -half - growth - Vector3::new(0.0, 0.0, tool.thickness),
            max: half + growth + Vector3::new(0.0, 0.0, margins.contact_front),
        };

        // Each part becomes a moving or a fixed shape.
        let mut moving = Vec::new();
        let mut fixed = Vec::new();
        let mut slots = Vec::new();
        let mut body_of = Vec::new();
        for part in &parts {
            let (solid, origin) = part.solid().expect("hulls are checked when they are read");
            let (body, carrier) = match part.link {
                Some(link) => bodies.links[link],
                None => (Some(bodies.tip_body), bodies.tip),
            };
            let place = carrier.then(&Frame::from(&origin));
            body_of.push(body);
            match body {
                Some(body) => {
                    slots.push(moving.len());
                    let touch = (body == bodies.tip_body)
                        .then(|| Touch::new(part, &solid, &place, &contact, &margins));
                    moving.push(Moving {
                        body,
                        place,
                        tree: SphereTree::new(&solid, &place),
                        shape: solid.to_parry(),
                        solid,
                        against: Vec::new(),
                        touch,
                    });
                }
                None => {
                    slots.push(fixed.len());
                    fixed.push(Fixed::new(solid, place, margins.self_clearance));
                }
            }
        }
        let mut moving_pairs = Vec::new();
        for &(a, b) in &pairs.checked {
            match (body_of[a], body_of[b]) {
                (Some(_), Some(_)) => moving_pairs.push((slots[a], slots[b])),
                (Some(_), None) => moving[slots[a]].against.push(slots[b]),
                _ => moving[slots[b]].against.push(slots[a]),
            }
        }
        moving_pairs.sort_by_key(|&(a, b): &(usize, usize)| (moving[a].body, moving[b].body));
        let mut scene_obstacles = Vec::new();
        for obstacle in obstacles {
            let solid = obstacle_solid(obstacle)?;
            for shape in &mut moving {
                shape.against.push(fixed.len());
            }
            scene_obstacles.push(SceneObstacle {
                name: obstacle.name.clone(),
                shape: solid.to_parry(),
                pose: obstacle.pose,
                carries_robot: obstacle.carries_robot,
            });
            fixed.push(Fixed::new(solid, Frame::from(&obstacle.pose), margins.environment));
        }

        let reach = Reach::new(&bodies, arm, &moving);
        let field = Field::new(scan_points, &reach.centre, reach.radius + margins.environment);
        let ranges = never::ranges(arm, &reach.travel);
        leave_out(&bodies, &ranges, &mut moving, &fixed, &mut moving_pairs, &margins);
        let scene = Scene {
            shapes,
            moves: body_of.iter().map(Option::is_some).collect(),
            at_tip: body_of.iter().map(|b| *b == Some(bodies.tip_body)).collect(),
            parts,
            points: scan_points.to_vec(),
            obstacles: scene_obstacles,
            pairs: pairs.checked,
            tool: tool.clone(),
            margins,
        };
        Ok(Self {
            arm: arm.clone(),
            bodies,
            moving,
            fixed,
            pairs: moving_pairs,
            field,
            reach,
            margins,
            contact,
            ranges,
            scene,
            excluded: pairs.excluded,
            notes,
        })
    }

    /// The link pairs that are not checked, and why; links rigid to each other are not listed.
    #[must_use]
    pub fn excluded(&self) -> &[Excluded] {
        &self.excluded
    }

    /// What was made up while building, in words: capsules in place of missing meshes.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The first link that does not move with the arm (base, torso, other arm) and is too near to
    /// the scan or to an obstacle that does not carry the robot. Slow: once per stance.
    #[must_use]
    pub fn stance_hit(&self) -> Option<Hit> {
        self.exact().stance_hit()
    }

    /// Whether every joint is where it may be asked about; NaN is not.
    #[inline]
    pub(crate) fn is_in_range(&self, q: &JointVector) -> bool {
        let inside = |(value, (low, high)): (&f64, &(f64, f64))| {
            value.is_finite() && low <= value && value <= high
        };
        q.iter().zip(&self.ranges).all(inside)
    }

    /// The exact check: slow, and independent of the fast one.
    #[must_use]
    pub fn exact(&self) -> Exact<'_> {
        Exact::new(self)
    }
}

/// Drops the pairs of the robot's shapes that are proven never to come near each other.
fn leave_out(
    bodies: &Bodies,
    ranges: &Ranges,
    moving: &mut [Moving],
    fixed: &[Fixed],
    pairs: &mut Vec<(usize, usize)>,
    margins: &Margins,
) {
    let need = margins.self_clearance;
    let never = |a: &Moving, body: Option<usize>, place: &Frame, solid: &Solid| {
        let own = Placed { body: Some(a.body), place: &a.place, solid: &a.solid };
        never_near(bodies, ranges, own, Placed { body, place, solid }, need)
    };
    pairs.retain(|&(a, b)| {
        let b = &moving[b];
        !never(&moving[a], Some(b.body), &b.place, &b.solid)
    });
    for k in 0..moving.len() {
        let mut against = std::mem::take(&mut moving[k].against);
        against.retain(|&f| !never(&moving[k], None, &fixed[f].place, &fixed[f].solid));
        moving[k].against = against;
    }
}

impl std::fmt::Debug for World {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("World")
            .field("moving", &self.moving.len())
            .field("fixed", &self.fixed.len())
            .field("pairs", &self.pairs.len())
            .field("points", &self.field.len())
            .finish_non_exhaustive()
    }
}

impl Moving {
    /// Upper bound of the distance of the shape, and of the places that it guards while it may
    /// touch, from the line through the body's origin along the unit vector `axis`. \[m\]
    pub(crate) fn reach_from_axis(&self, axis: &Vector3<f64>) -> f64 {
        let beside = |c: &Vector3<f64>| (c - axis * axis.dot(c)).norm();
        self.corners().map(beside).fold(self.tree.reach_from_axis(axis), f64::max)
    }

    /// The same, from a point of the body. \[m\]
    pub(crate) fn reach_from(&self, origin: &Vector3<f64>) -> f64 {
        let away = |c: &Vector3<f64>| (c - origin).norm();
        self.corners().map(away).fold(self.tree.reach_from(origin), f64::max)
    }

    fn corners(&self) -> impl Iterator<Item = &Vector3<f64>> {
        self.touch.iter().flat_map(|touch| &touch.corners)
    }
}

impl Fixed {
    fn new(solid: Solid, place: Frame, margin: f64) -> Self {
        let (low, high) = solid.bounds();
        let (min, max) = if low.iter().chain(&high).all(|x| x.is_finite()) {
            let centre = place.apply(&(0.5 * (low + high)));
            let half = place.rotation.abs() * (0.5 * (high - low));
            (centre - half, centre + half)
        } else {
            (Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY))
        };
        Self { shape: solid.to_parry(), solid, place, min, max, margin }
    }
}

impl Touch {
    fn new(
        part: &Part,
        solid: &Solid,
        place: &Frame,
        contact: &Contact,
        margins: &Margins,
    ) -> Self {
        let (margin, depth) = if part.is_pad {
            (margins.environment.min(margins.contact_growth), f64::INFINITY)
        } else {
            (margins.environment.min(margins.contact_clearance), margins.contact_depth)
        };
        // Bounds of the shape grown by its margin, in the contact frame.
        let local = contact.frame.inverse_then(place);
        let (low, high) = solid.bounds();
        let centre = local.apply(&(0.5 * (low + high)));
        let half = local.rotation.abs() * (0.5 * (high - low)) + Vector3::repeat(margin);
        let (min, max) = (centre - half, centre + half);
        let mut keep_out = Vec::new();
        for axis in 0..3 {
            if max[axis] > contact.max[axis] + 1e-9 {
                let mut from = min;
                from[axis] = min[axis].max(contact.max[axis]);
                keep_out.push((from, max));
            }
            if min[axis] < contact.min[axis] - 1e-9 {
                let mut to = max;
                to[axis] = max[axis].min(contact.min[axis]);
                keep_out.push((min, to));
            }
        }
        let (mut guards, mut tree) = (Vec::new(), SphereTree::default());
        if part.is_pad {
            for (low, high) in &keep_out {
                let cover = Solid::Box { half: 0.5 * (high - low) };
                let at = Frame { translation: 0.5 * (low + high), ..Frame::IDENTITY };
                let at = contact.frame.then(&at);
                tree.append(&SphereTree::new(&cover, &at));
                guards.push((at, cover));
            }
        }
        let corners = keep_out
            .iter()
            .flat_map(|(low, high)| {
                (0..8).map(move |n| {
                    let pick = |i: usize| if n >> i & 1 == 0 { low[i] } else { high[i] };
                    Vector3::new(pick(0), pick(1), pick(2))
                })
            })
            .map(|corner| contact.frame.apply(&corner))
            .collect();
        Self { margin, depth, keep_out, corners, guards, tree }
    }
}

fn check_input(points: &[Point3<f64>], margins: &Margins) -> Result<(), CollisionError> {
    for (name, value) in [
        ("self_clearance", margins.self_clearance),
        ("environment", margins.environment),
        ("contact_growth", margins.contact_growth),
        ("contact_front", margins.contact_front),
        ("contact_clearance", margins.contact_clearance),
        ("contact_depth", margins.contact_depth),
    ] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(CollisionError::Margin { name, value });
        }
    }
    match points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        Some(index) => Err(CollisionError::NotFinite { index }),
        None => Ok(()),
    }
}

fn obstacle_solid(obstacle: &Obstacle) -> Result<Solid, CollisionError> {
    let failed = |error| CollisionError::ObstacleMesh { obstacle: obstacle.name.clone(), error };
    Ok(match &obstacle.shape {
        ObstacleShape::Box { half_extents } => Solid::Box { half: *half_extents },
        ObstacleShape::Floor => Solid::HalfSpace,
        ObstacleShape::Mesh { path } => {
            let points = read_stl(path, &Vector3::repeat(1.0)).map_err(failed)?;
            let hull = Hull::new(&points).ok_or_else(|| {
                failed(MeshError::Flat { path: path.clone(), vertices: points.len() })
            })?;
            Solid::Hull(Box::new(hull))
        }
    })
}
