//! Regions of a scene: where each of its points belongs, and what is swept in which order.

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::Obstacle;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::error::RegionError;
use super::volume::Volume;

/// A region: what lies in all of its volumes.
#[derive(Clone, Debug)]
pub struct Region {
    /// For people.
    pub name: String,
    /// What it is for.
    pub kind: Kind,
    /// Its volumes.
    pub volumes: Vec<Volume>,
}

/// What a region is for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// It is to be swept; where there is such a region, nothing else is.
    Sweep(Sweep),
    /// The tool never touches what is in it.
    KeepOut,
    /// Nothing of robot or tool comes into it.
    Avoid,
}

/// How a region is to be swept.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// How often the tool is to pass over each point, 1….
    pub passes: u32,
    /// Speed of the pad's centre on it; `None`: as everywhere. \[m/s\]
    pub tool_speed: Option<f64>,
    /// What is swept first: the greater.
    pub priority: i32,
}

impl Default for Sweep {
    fn default() -> Self {
        Self { passes: 1, tool_speed: None, priority: 0 }
    }
}

/// Where a point of the surface belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// To no region: it is swept where no region is to be swept.
    None,
    /// To the region of this index, which is to be swept.
    Sweep(usize),
    /// To the region of this index, which the tool keeps out of.
    KeepOut(usize),
}

/// The regions of a scene, in its frame.
#[derive(Clone, Debug, Default)]
pub struct Regions {
    all: Vec<Region>,
}

/// What a plan keeps of a region that it was made for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub kind: Kind,
    /// How many points of the surface belong to it.
    pub points: usize,
}

/// What is swept before anything else is begun.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Regions that are to be swept, as indices; empty: everything.
    pub regions: Vec<usize>,
    /// The how-manieth pass over them it is, from 1 on.
    pub pass: u32,
    /// Speed of the pad's centre; `None`: as asked for everywhere. \[m/s\]
    pub tool_speed: Option<f64>,
}

impl Region {
    /// Whether it holds a point.
    #[must_use]
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        self.volumes.iter().all(|volume| volume.contains(p))
    }

    /// The point that is least outside of it, and by how much: of its volumes the farthest. \[m\]
    fn nearest<'a>(
        &self,
        points: impl Iterator<Item = &'a Point3<f64>>,
    ) -> Option<(&'a Point3<f64>, f64)> {
        let apart =
            |p: &Point3<f64>| self.volumes.iter().map(|v| v.distance(p)).fold(0.0, f64::max);
        points.map(|p| (p, apart(p))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn nothing<'a>(
        &self,
        of: &'static str,
        points: impl Iterator<Item = &'a Point3<f64>>,
    ) -> RegionError {
        let region = self.name.clone();
        match self.nearest(points) {
            Some((p, distance_m)) => {
                RegionError::Nothing { region, of, nearest: (*p).into(), distance_m }
            }
            None => RegionError::Region {
                region,
                what: format!("it holds no point of {of}: there is none"),
            },
        }
    }
}

impl Regions {
    /// Of some, those first that a point belongs to which is in several.
    #[must_use]
    pub fn new(all: Vec<Region>) -> Self {
        Self { all }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Them.
    #[must_use]
    pub fn all(&self) -> &[Region] {
        &self.all
    }

    /// Seen from another frame.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        let moved = |region: &Region| Region {
            volumes: region.volumes.iter().map(|volume| volume.transformed(pose)).collect(),
            ..region.clone()
        };
        Self { all: self.all.iter().map(moved).collect() }
    }

    /// Whether one of them is to be swept.
    #[must_use]
    pub fn are_swept(&self) -> bool {
        self.sweeps().next().is_some()
    }

    /// Where points of a surface belong: what is to be kept out of comes before what is to be swept,
    /// of these the first.
    #[must_use]
    pub fn labels(&self, points: &[Point3<f64>]) -> Vec<Label> {
        points.par_iter().map(|p| self.label(p)).collect()
    }

    fn label(&self, p: &Point3<f64>) -> Label {
        let first = |is: fn(&Kind) -> bool| {
            self.all.iter().position(|region| is(&region.kind) && region.contains(p))
        };
        if let Some(region) = first(|kind| *kind == Kind::KeepOut) {
            return Label::KeepOut(region);
        }
        first(|kind| matches!(kind, Kind::Sweep(_))).map_or(Label::None, Label::Sweep)
    }

    /// Whether a point of a label is to be swept.
    #[must_use]
    pub fn is_wanted(&self, label: Label) -> bool {
        match label {
            Label::None => !self.are_swept(),
            Label::Sweep(_) => true,
            Label::KeepOut(_) => false,
        }
    }

    /// How often a point of a label is to be passed over.
    #[must_use]
    pub fn passes(&self, label: Label) -> u32 {
        match label {
            Label::Sweep(region) => match self.all[region].kind {
                Kind::Sweep(sweep) => sweep.passes,
                Kind::KeepOut | Kind::Avoid => 0,
            },
            _ => u32::from(self.is_wanted(label)),
        }
    }

    /// Those of some points that the tool keeps out of.
    #[must_use]
    pub fn keep_out<'a>(&self, points: impl Iterator<Item = &'a Point3<f64>>) -> Vec<Point3<f64>> {
        let kept: Vec<&Region> = self.all.iter().filter(|r| r.kind == Kind::KeepOut).collect();
        if kept.is_empty() {
            return Vec::new();
        }
        points.filter(|p| kept.iter().any(|region| region.contains(p))).copied().collect()
    }

    /// The solid things that nothing of the robot comes into.
    #[must_use]
    pub fn solids(&self) -> Vec<Obstacle> {
        let avoided = self.all.iter().filter(|region| region.kind == Kind::Avoid);
        avoided.flat_map(|r| r.volumes.iter().filter_map(|v| v.obstacle(&r.name))).collect()
    }

    /// The regions that are to be swept, as indices, with how.
    fn sweeps(&self) -> impl Iterator<Item = (usize, Sweep)> {
        self.all.iter().enumerate().filter_map(|(i, region)| match region.kind {
            Kind::Sweep(sweep) => Some((i, sweep)),
            Kind::KeepOut | Kind::Avoid => None,
        })
    }

    /// What is swept in which order: of greater priority first, at one speed together, pass after pass.
    #[must_use]
    pub fn rounds(&self) -> Vec<Round> {
        // What is alike, with the most passes over any of it.
        let mut groups: Vec<(Sweep, Vec<usize>)> = Vec::new();
        for (region, sweep) in self.sweeps() {
            let is_alike =
                |of: &Sweep| of.priority == sweep.priority && of.tool_speed == sweep.tool_speed;
            match groups.iter_mut().find(|(of, _)| is_alike(of)) {
                Some((of, regions)) => {
                    of.passes = of.passes.max(sweep.passes);
                    regions.push(region);
                }
                None => groups.push((sweep, vec![region])),
            }
        }
        groups.sort_by_key(|(of, _)| std::cmp::Reverse(of.priority));
        let mut rounds = Vec::new();
        for (Sweep { passes, tool_speed, .. }, of) in groups {
            for pass in 1..=passes {
                let is_due = |region: &usize| self.passes(Label::Sweep(*region)) >= pass;
                let regions = of.iter().copied().filter(is_due).collect();
                rounds.push(Round { regions, pass, tool_speed });
            }
        }
        if rounds.is_empty() {
            rounds.push(Round { regions: Vec::new(), pass: 1, tool_speed: None });
        }
        rounds
    }

    /// Refuses regions that match nothing of a surface, or of what else was measured, in the floor frame.
    ///
    /// # Errors
    /// [`RegionError::Nothing`] or [`RegionError::Covered`].
    pub fn check(
        &self,
        surface: &[Point3<f64>],
        others: &[Point3<f64>],
    ) -> Result<(), RegionError> {
        let labels = self.labels(surface);
        for (index, region) in self.all.iter().enumerate() {
            match region.kind {
                Kind::Avoid => {}
                Kind::KeepOut => {
                    let mut points = surface.iter().chain(others);
                    if !points.any(|p| region.contains(p)) {
                        let points = surface.iter().chain(others);
                        return Err(region.nothing("what was measured", points));
                    }
                }
                Kind::Sweep(_) if labels.contains(&Label::Sweep(index)) => {}
                Kind::Sweep(_) => {
                    let own = surface.iter().zip(&labels).find(|(p, _)| region.contains(p));
                    return Err(match own {
                        Some((_, Label::Sweep(other) | Label::KeepOut(other))) => {
                            let other = self.all[*other].name.clone();
                            RegionError::Covered { region: region.name.clone(), other }
                        }
                        _ => region.nothing("the surface", surface.iter()),
                    });
                }
            }
        }
        Ok(())
    }

    /// What a plan for points with these labels keeps of them.
    #[must_use]
    pub fn marks(&self, labels: &[Label]) -> Vec<Mark> {
        let count = |index: usize| {
            let own = [Label::Sweep(index), Label::KeepOut(index)];
            labels.iter().filter(|label| own.contains(label)).count()
        };
        let mark = |(index, region): (usize, &Region)| Mark {
            name: region.name.clone(),
            kind: region.kind,
            points: count(index),
        };
        self.all.iter().enumerate().map(mark).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::regions::Shape;

    fn region(name: &str, kind: Kind, x: f64, half: f64) -> Region {
        let shape = Shape::Box { half: Vector3::repeat(half) };
        let volumes = vec![Volume { shape, pose: Isometry3::translation(x, 0.0, 0.0) }];
        Region { name: name.into(), kind, volumes }
    }

    fn sweep(passes: u32, tool_speed: Option<f64>, priority: i32) -> Kind {
        Kind::Sweep(Sweep { passes, tool_speed, priority })
    }

    /// A line of points a centimetre apart from 0 to 1 m.
    fn line() -> Vec<Point3<f64>> {
        (0..=100).map(|i| Point3::new(0.01 * f64::from(i), 0.0, 0.0)).collect()
    }

    #[test]
    fn a_point_belongs_to_what_is_kept_out_of_then_to_the_first_region() {
        let regions = Regions::new(vec![
            region("a", sweep(1, None, 0), 0.2, 0.1005),
            region("b", sweep(2, None, 0), 0.3, 0.1005),
            region("clamp", Kind::KeepOut, 0.2, 0.0205),
        ]);
        let labels = regions.labels(&line());
        let count = |label| labels.iter().filter(|l| **l == label).count();
        assert_eq!([count(Label::KeepOut(2)), count(Label::Sweep(0))], [5, 16]);
        assert_eq!([count(Label::Sweep(1)), count(Label::None)], [10, 70]);
        let wanted = labels.iter().filter(|l| regions.is_wanted(**l)).count();
        assert_eq!(wanted, 26);
        assert_eq!(regions.passes(Label::Sweep(1)), 2);
        assert_eq!(regions.keep_out(line().iter()).len(), 5);
        // Without a region to sweep all is swept but what is kept out of.
        let kept = Regions::new(vec![region("clamp", Kind::KeepOut, 0.2, 0.0205)]);
        let wanted = kept.labels(&line()).into_iter().filter(|l| kept.is_wanted(*l)).count();
        assert_eq!(wanted, 96);
        assert_eq!(kept.passes(Label::None), 1);
        let points: Vec<usize> = regions.marks(&labels).iter().map(|mark| mark.points).collect();
        assert_eq!(points, [16, 10, 5]);
    }

    #[test]
    fn what_matters_more_is_swept_first_and_pass_comes_after_pass() {
        let regions = Regions::new(vec![
            region("late", sweep(1, None, -1), 0.1, 0.05),
            region("twice", sweep(2, None, 0), 0.3, 0.05),
            region("once", sweep(1, None, 0), 0.5, 0.05),
            region("slow", sweep(1, Some(0.05), 0), 0.7, 0.05),
        ]);
        let rounds = regions.rounds();
        let told: Vec<_> = rounds.iter().map(|r| (r.regions.clone(), r.pass)).collect();
        assert_eq!(told, [(vec![1, 2], 1), (vec![1], 2), (vec![3], 1), (vec![0], 1)]);
        assert_eq!(rounds[2].tool_speed, Some(0.05));
        assert_eq!(Regions::default().rounds().len(), 1);
    }

    #[test]
    fn a_region_that_matches_nothing_says_what_is_nearest() {
        let beside = Regions::new(vec![region("beside", sweep(1, None, 0), 1.35, 0.1)]);
        let error = beside.check(&line(), &[]).expect_err("it is beside").to_string();
        assert!(error.contains("region beside holds no point of the surface"), "{error}");
        assert!(error.contains("(1.000, 0.000, 0.000)") && error.contains("0.250 m"), "{error}");
        let post = [Point3::new(1.4, 0.0, 0.0)];
        let kept = Regions::new(vec![region("post", Kind::KeepOut, 1.35, 0.1)]);
        kept.check(&line(), &post).expect("it was measured beside the surface");
        let error = kept.check(&line(), &[]).expect_err("nothing is there").to_string();
        assert!(error.contains("no point of what was measured"), "{error}");
        let hidden = Regions::new(vec![
            region("all", sweep(1, None, 0), 0.5, 0.4),
            region("within", sweep(2, None, 0), 0.5, 0.1),
        ]);
        let error = hidden.check(&line(), &[]).expect_err("nothing is left of it").to_string();
        assert!(error.contains("region within belong to region all"), "{error}");
        let empty = Regions::new(vec![region("air", Kind::Avoid, 5.0, 0.1)]);
        empty.check(&line(), &[]).expect("nothing needs to be where nothing may come");
        assert_eq!(empty.solids().len(), 1);
    }
}
