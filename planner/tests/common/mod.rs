//! What several tests plan for. Each of them uses a part.
#![allow(dead_code, reason = "each test compiles this by itself")]

use std::sync::Mutex;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use nullsweep_collision::Options;
use nullsweep_planner::poses::{self, Setup, Tolerance};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::timing::Speed;
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{ArmSpec, Side, Tool};
use nullsweep_surface::{CleanConfig, Placement, place, simulate};

/// The seat of the simulated chair, the rest of it in the way.
pub(crate) fn seat() -> Scene {
    let view = simulate::chair(1);
    let (placed, _) = place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    Scene::seen(&placed, Some(&simulate::chair_seat()), &CleanConfig::default())
        .expect("the seat is there")
        .0
}

/// Poses on a dome before the PR2: z into it, x upwards.
pub(crate) fn dome() -> Vec<Isometry3<f64>> {
    let mut poses = Vec::new();
    for i in -2..=2 {
        for k in -2..=2 {
            let (yaw, pitch) = (0.15 * f64::from(i), 0.15 * f64::from(k));
            let outward = UnitQuaternion::from_euler_angles(0.0, pitch, yaw) * -Vector3::x();
            let at = Vector3::new(0.95, -0.3, 0.85) + outward * 0.3;
            let frame = UnitQuaternion::face_towards(&-outward, &Vector3::y());
            poses.push(Isometry3::from_parts(Translation3::from(at), frame));
        }
    }
    poses
}

/// Poses of the gripper's tool frame, its x axis ahead, met by the PR2's right arm.
pub(crate) fn setup(tolerance: Tolerance) -> Setup {
    Setup {
        arm: ArmSpec::pr2(Side::Right),
        tool: Tool { approach: [1.0, 0.0, 0.0], ..poses::tip_tool() },
        tolerance,
        stance: Stance { base: [0.0; 3], height: 0.0, held: Vec::new() },
        start: None,
        speed: Speed::default(),
        collision: Options::default(),
        seed: 1,
    }
}

/// Keeps what is told.
#[derive(Default)]
pub(crate) struct Notes(pub(crate) Mutex<Vec<String>>);

impl Progress for Notes {
    fn stage(&self, _: &'static str, _: Option<usize>) {}
    fn tick(&self) {}
    fn note(&self, text: &str) {
        self.0.lock().unwrap().push(text.into());
    }
}
