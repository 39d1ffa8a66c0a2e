//! The scan that a command works on, from files or simulated, in the floor frame.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use nalgebra::{Isometry3, Point3};
use nullsweep_collision::Obstacle;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::regions::{Around, Spec};
use nullsweep_planner::workcell::Scene;
use nullsweep_surface::{CleanConfig, CropBox, PlacedScan, Placement, scan, simulate, unseen};

use crate::bars::Bars;
use crate::floor::{Placed, Source};
use crate::obstacles;
use crate::placed::{Gravity, PlacedArgs, read_scans};
use crate::room::{self, ObjectChoice};
use crate::table::{self, TableSize};

/// How the scans stand, what of them is swept, and what else is there.
#[derive(Clone, Debug, Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    placed: PlacedArgs,
    /// Size of that table's top, along x and y of the floor frame, the object in its middle; without
    /// it the table is taken to reach 0.45 m beyond the object on every side. [m]
    #[arg(long, value_name = "LxW", requires = "support_height")]
    table: Option<TableSize>,
    /// What the space that no view has seen is: kept clear of, but for 2 cm that a sensor may be wrong
    /// by (avoid), kept clear of altogether (forbid), or taken for free.
    #[arg(long, value_enum, default_value = "avoid")]
    unseen: UnseenArg,
    /// Keep only this box of the floor frame as the surface to sweep, the rest stays an obstacle:
    /// xmin,ymin,zmin,xmax,ymax,zmax.
    #[arg(long, value_name = "BOX", allow_hyphen_values = true)]
    crop: Option<CropBox>,
    /// Sweep only this object of the scene: by its number from `planner scene`, by a point of it
    /// X,Y,Z, or the one with the most points, `largest` or `largest-on-table`. Without --up,
    /// --sensor-pose: gravity is found by the largest level plane.
    #[arg(long, value_name = "OBJECT", conflicts_with = "crop", allow_hyphen_values = true)]
    object: Option<ObjectChoice>,
    /// Solid things that are placed, not measured: a TOML file with tables [[box]] (centre, size, rpy),
    /// [[cylinder]] (centre, radius, height, rpy) and [[sphere]] (centre, radius), in the floor frame.
    #[arg(long, value_name = "FILE")]
    obstacles: Option<PathBuf>,
    /// What is to be swept, how often and how fast, what the tool keeps out of, and what nothing of the
    /// robot enters: a TOML file with tables [[region]] (docs/process.md); without it the one that the
    /// scene file names.
    #[arg(long, value_name = "FILE")]
    regions: Option<PathBuf>,
}

impl SceneArgs {
    /// The same, of an object at a point of the floor frame where nothing else is chosen.
    pub(super) fn or_at(&self, point: Point3<f64>) -> Self {
        let chosen = self.object.is_some() || self.crop.is_some();
        let object = if chosen { self.object } else { Some(ObjectChoice::At(point)) };
        Self { object, ..self.clone() }
    }

    /// Whether solid things are placed.
    pub(super) fn has_obstacles(&self) -> bool {
        self.obstacles.is_some()
    }

    /// The solid things that are placed.
    pub(super) fn obstacles(&self) -> anyhow::Result<Vec<Obstacle>> {
        self.obstacles.as_deref().map_or(Ok(Vec::new()), obstacles::read)
    }

    /// What is placed, and nothing measured.
    pub(super) fn unscanned(&self, floor: Obstacle) -> anyhow::Result<Scene> {
        self.beside(Scene::of_obstacles(vec![floor]))
    }

    /// A scene that is known otherwise than by scans, with what is placed beside it.
    pub(super) fn beside(&self, mut scene: Scene) -> anyhow::Result<Scene> {
        scene.obstacles.extend(self.obstacles()?);
        let nothing = Around {
            scan: &PlacedScan::default(),
            scan_to_floor: Isometry3::identity(),
            seed: room::SEED,
        };
        with_regions(scene, self.regions.as_deref(), &nothing)
    }

    /// How the scans stand.
    pub(super) fn placed(&self) -> &PlacedArgs {
        &self.placed
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Demo {
    /// A kitchen chair.
    Chair,
    /// The chair's seat alone; the rest of it is an obstacle.
    ChairSeat,
    /// A ride-on toy car.
    BobbyCar,
    /// A car's door without its window, upright.
    CarDoor,
}

/// What becomes of the space that no view has seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum UnseenArg {
    /// Nothing of robot or tool comes deeper than 2 cm into it.
    Avoid,
    /// Nothing of robot or tool comes into it.
    Forbid,
    /// It is free.
    Free,
}

/// Reads and joins the scans, or simulates `demo`'s with the noise of `seed`, and cleans them.
pub(super) fn scene(
    args: &SceneArgs,
    demo: Option<Demo>,
    scans: &[PathBuf],
    seed: u64,
    bars: &Bars,
) -> anyhow::Result<Scene> {
    Ok(seen(args, demo, scans, seed, bars)?.0)
}

/// The same with the scans as they were read.
pub(super) fn seen(
    args: &SceneArgs,
    demo: Option<Demo>,
    scans: &[PathBuf],
    seed: u64,
    bars: &Bars,
) -> anyhow::Result<(Scene, Placed)> {
    let (placed, (mut scene, flying)) = if let Some(choice) = args.object {
        ensure!(demo.is_none(), "--object chooses from a scan, not from a demo");
        let placed = read_scans(&args.placed, scans, seed, Gravity::Found, bars)?;
        let seen = room::object(&placed, choice, bars)?;
        (placed, seen)
    } else {
        let (placed, region) = match demo {
            Some(demo) => simulated(demo, seed),
            None => (read_scans(&args.placed, scans, seed, Gravity::Given, bars)?, None),
        };
        let region = args.crop.or(region);
        let seen = Scene::seen(&placed.scan, region.as_ref(), &CleanConfig::default())?;
        (placed, seen)
    };
    if !flying.is_empty() {
        let flying = flying.len();
        bars.note(&format!("{flying} points fly alone and are taken for nothing"));
    }
    match args.unseen {
        UnseenArg::Free if !scene.unseen.is_empty() => {
            scene.unseen.clear();
            bars.note("space that no view has seen counts as free");
        }
        UnseenArg::Forbid if scene.unseen.is_empty() => bars.note(
            "no view has a known sensor: which space was not seen is not known, and none is kept clear of",
        ),
        UnseenArg::Forbid => scene.unseen = unseen::border(&placed.scan, &scene.surface, 0.0),
        UnseenArg::Free | UnseenArg::Avoid => {}
    }
    if demo.is_some() && args.placed.support_height > 0.0 {
        bars.note("a simulated scene stands on the floor: there is no table under it");
    } else if args.placed.support_height > 0.0 {
        scene.obstacles.extend(table::under(
            &scene.surface,
            args.placed.support_height,
            args.table,
            bars,
        ));
    }
    scene.obstacles.extend(args.obstacles()?);
    let around = Around {
        scan: &placed.scan,
        scan_to_floor: placed.sources.first().map_or_else(Isometry3::identity, |first| first.pose),
        seed: placed.seed.unwrap_or(room::SEED),
    };
    let regions = args.regions.as_deref().or(placed.regions.as_deref());
    let scene = with_regions(scene, regions, &around)?;
    Ok((scene, placed))
}

/// The scene with the regions of a file, if there is one.
fn with_regions(scene: Scene, file: Option<&Path>, around: &Around<'_>) -> anyhow::Result<Scene> {
    let Some(file) = file else { return Ok(scene) };
    let regions = Spec::read(file)?.find(around).with_context(|| file.display().to_string())?;
    scene.with_regions(regions).with_context(|| file.display().to_string())
}

fn simulated(demo: Demo, seed: u64) -> (Placed, Option<CropBox>) {
    let (view, region) = match demo {
        Demo::Chair => (simulate::chair(seed), None),
        Demo::ChairSeat => (simulate::chair(seed), Some(simulate::chair_seat())),
        Demo::BobbyCar => (simulate::bobby_car(seed), None),
        Demo::CarDoor => (simulate::car_door(seed), None),
    };
    let (scan, pose) = scan::place(&view.scan, &Placement::SensorPose(view.sensor_pose));
    let source = Source { file: PathBuf::new(), scale: 1.0, pose };
    (Placed { scan, sources: vec![source], regions: None, seed: None }, region)
}
