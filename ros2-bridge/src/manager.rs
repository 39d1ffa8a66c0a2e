//! What the controller_manager says of the controllers: which are loaded, and in what state.

use std::time::{Duration, Instant};

use ros2_client::service::Client;
use ros2_client::{Message, Name, Node, ServiceMapping, ServiceTypeName};
use serde::{Deserialize, Serialize};

use crate::domain::{absolute, reliable};

/// Time between two questions, while something is amiss.
const AGAIN: Duration = Duration::from_secs(1);
/// The states that a controller can be in.
const STATES: [&str; 4] = ["unconfigured", "inactive", "active", "finalized"];

/// `controller_manager_msgs/ListControllers`, asked: a message without fields has one byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Question {
    nothing: u8,
}
impl Message for Question {}

/// Answered, with controllers of one layout.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct List<C> {
    controller: Vec<C>,
}
impl<C: Message> Message for List<C> {}

/// `controller_manager_msgs/ChainConnection`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Connection {
    name: String,
    reference_interfaces: Vec<String>,
}

/// `controller_manager_msgs/ControllerState`, as Jazzy and later have it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Jazzy {
    name: String,
    state: String,
    kind: String,
    claimed: Vec<String>,
    commands: Vec<String>,
    states: Vec<String>,
    is_chainable: bool,
    is_chained: bool,
    exported_states: Vec<String>,
    references: Vec<String>,
    connections: Vec<Connection>,
}
impl Message for Jazzy {}

/// The same as Humble and Iron have it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Humble {
    name: String,
    state: String,
    kind: String,
    claimed: Vec<String>,
    commands: Vec<String>,
    states: Vec<String>,
    is_chainable: bool,
    is_chained: bool,
    references: Vec<String>,
    connections: Vec<Connection>,
}
impl Message for Humble {}

/// A controller and its state.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Loaded {
    name: String,
    state: String,
}

/// The controllers in a list, if it was read by the layout that it has.
fn read<C>(list: List<C>, of: impl Fn(C) -> (String, String)) -> Option<Vec<Loaded>> {
    let all = list.controller.into_iter().map(of);
    let all: Vec<_> = all.map(|(name, state)| Loaded { name, state }).collect();
    all.iter().all(|c| STATES.contains(&c.state.as_str())).then_some(all)
}

/// Asks the controller_manager. Which layout it has is not known, so it is asked in each.
pub struct Manager {
    jazzy: Client<Question, List<Jazzy>>,
    humble: Client<Question, List<Humble>>,
    name: String,
    /// The controller that is meant, as the manager names it.
    controller: String,
    asked: Option<Instant>,
    said: Option<Vec<Loaded>>,
}

impl Manager {
    /// The manager of that name, asked for that controller.
    pub fn open(node: &mut Node, name: &str, controller: &str) -> anyhow::Result<Self> {
        let service = Name::parse(&format!("{}/list_controllers", absolute(name)))?;
        let kind = ServiceTypeName::new("controller_manager_msgs", "ListControllers");
        let (mapping, qos) = (ServiceMapping::Enhanced, reliable(10));
        let controller = controller.rsplit('/').next().unwrap_or(controller);
        Ok(Self {
            jazzy: node.create_client(mapping, &service, &kind, qos.clone(), qos.clone())?,
            humble: node.create_client(mapping, &service, &kind, qos.clone(), qos)?,
            name: absolute(name),
            controller: controller.into(),
            asked: None,
            said: None,
        })
    }

    /// Asks now and then, and takes in what has come.
    pub fn ask(&mut self) {
        if self.asked.is_none_or(|at| at.elapsed() >= AGAIN) {
            self.asked = Some(Instant::now());
            // Nobody may be there.
            let _ = self.jazzy.send_request(Question::default());
            let _ = self.humble.send_request(Question::default());
        }
        while let Ok(Some((_, list))) = self.jazzy.receive_response() {
            self.said = read(list, |c| (c.name, c.state)).or(self.said.take());
        }
        while let Ok(Some((_, list))) = self.humble.receive_response() {
            self.said = read(list, |c| (c.name, c.state)).or(self.said.take());
        }
    }

    /// What it said was long ago, or it is not the time to ask.
    pub fn forget(&mut self) {
        self.said = None;
    }

    /// What it said, in words; `None` where it has not answered.
    pub fn said(&self) -> Option<String> {
        self.said.as_ref().map(|all| words(&self.name, &self.controller, all))
    }
}

fn words(manager: &str, controller: &str, all: &[Loaded]) -> String {
    let others: Vec<_> = all.iter().map(|c| format!("{} ({})", c.name, c.state)).collect();
    let others = if others.is_empty() { "none".to_string() } else { others.join(", ") };
    match all.iter().find(|c| c.name == controller) {
        Some(c) if c.state == "inactive" => format!(
            "{manager} says that {controller} is inactive: `ros2 control switch_controllers --activate \
             {controller}`"
        ),
        Some(c) => format!("{manager} says that {controller} is {}", c.state),
        None => format!(
            "{manager} has no {controller}; loaded are: {others}. `ros2 control load_controller \
             {controller}`, or --controller for another one"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(all: &[(&str, &str)]) -> Vec<Loaded> {
        let one = |&(name, state): &(&str, &str)| Loaded { name: name.into(), state: state.into() };
        all.iter().map(one).collect()
    }

    #[test]
    fn a_controller_that_is_not_there_or_not_active_is_named() {
        let all = loaded(&[("arm_controller", "inactive"), ("broadcaster", "active")]);
        let said = |controller: &str| words("/controller_manager", controller, &all);
        assert!(said("arm_controller").contains("switch_controllers --activate arm_controller"));
        assert_eq!(said("broadcaster"), "/controller_manager says that broadcaster is active");
        let missing = said("other");
        for told in ["has no other", "arm_controller (inactive), broadcaster (active)"] {
            assert!(missing.contains(told), "{missing}");
        }
        assert!(words("/m", "x", &[]).contains("loaded are: none"));
    }

    #[test]
    fn a_list_of_another_layout_is_not_taken() {
        let list = |state: &str| List {
            controller: vec![Humble { name: "a".into(), state: state.into(), ..Humble::default() }],
        };
        let of = |c: Humble| (c.name, c.state);
        assert_eq!(read(list("active"), of), Some(loaded(&[("a", "active")])));
        assert_eq!(read(list("joint_trajectory_controller/J"), of), None);
    }
}
