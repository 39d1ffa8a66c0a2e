//! What is looked at from afar, and what stands before it.

use nalgebra::Point3;
use nullsweep_collision::{CollisionError, Options, Solids};
use nullsweep_robot::Tool;
use nullsweep_surface::Scan;

use crate::workcell::Scene;

/// The surface that is worked on, and what may hide it from a tool that works from afar; all in one
/// frame. A scan alone hides only itself.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    /// The surface.
    pub scan: &'a Scan,
    /// Other measured points. \[m\]
    pub beside: &'a [Point3<f64>],
    /// Solid things.
    pub solids: Option<&'a Solids>,
}

impl<'a> Sight<'a> {
    /// Of a scene, its solid things made ready.
    #[must_use]
    pub fn of(scene: &'a Scene, solids: Option<&'a Solids>) -> Self {
        Self { scan: &scene.surface, beside: &scene.surroundings, solids }
    }
}

/// What of a scene may hide its surface from a tool besides measured points: nothing from one that
/// touches.
///
/// # Errors
/// A mesh of an obstacle cannot be used.
pub fn solids(
    scene: &Scene,
    tool: &Tool,
    options: &Options,
) -> Result<Option<Solids>, CollisionError> {
    let make = || Solids::new(&scene.obstacles, &options.meshes);
    (!tool.touches()).then(make).transpose()
}

impl<'a> From<&'a Scan> for Sight<'a> {
    fn from(scan: &'a Scan) -> Self {
        Self { scan, beside: &[], solids: None }
    }
}
