//! The paper's experiments (§V): its three methods on its two objects, in its own model and in
//! ours.

mod figures;
mod methods;
mod paper;
mod report;
mod setting;
mod tables;

pub use figures::{FigureError, write as draw};
pub use methods::{Figures, Run, Task, V_MAX, by_cost, plan};
pub use paper::{Published, cannot_hold, cell, samples};
pub use report::{
    Cell, METHODS, Plan, Report, SettingFigures, Straight, Tracked, look_between, run, tracked,
};
pub use setting::{Setting, SettingError};
pub use tables::{csv, markdown};

use serde::{Deserialize, Serialize};

/// The paper's objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Object {
    /// Table I.
    Chair,
    /// Table II.
    BobbyCar,
}

/// The rows of the paper's tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Euclidean distance. \[m\]
    Distance,
    /// Effort. \[rad\]
    Effort,
    /// Task time. \[s\]
    Time,
    /// Calculation time. \[s\]
    Calculation,
    /// Processor time of the calculation, which the paper does not tell. \[s\]
    Processor,
}
