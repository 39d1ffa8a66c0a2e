//! Joining a ROS 2 domain.

use anyhow::Context as _;
use ros2_client::dds::rustdds::{DomainParticipantBuilder, Topic};
use ros2_client::qos::{History, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, QosProfile};

use crate::args::Common;

/// A node in the domain.
pub fn join(common: &Common, name: &str) -> anyhow::Result<Node> {
    let mut builder = DomainParticipantBuilder::new(common.domain);
    let networks = common.networks();
    if !networks.is_empty() {
        builder = builder.with_only_networks(networks);
    }
    let participant = builder.build().context("ROS 2's domain cannot be joined")?;
    let context = Context::from_domain_participant(participant)?;
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    Ok(context.new_node(NodeName::new("/", name)?, options)?)
}

/// Starts what keeps a node's picture of the others, once all that is its own has been made.
pub fn spin(node: &mut Node) -> anyhow::Result<()> {
    let spinner = node.spinner()?;
    std::thread::Builder::new()
        .name("ros".into())
        .spawn(move || futures::executor::block_on(spinner.spin()))?;
    Ok(())
}

/// A topic by its name from the root, and its type's package and name.
pub fn topic(node: &Node, name: &str, (package, kind): (&str, &str)) -> anyhow::Result<Topic> {
    let parsed = Name::parse(name).with_context(|| format!("{name} is no topic's name"))?;
    // What is asked for is said where it is opened.
    let any = QosProfile::publisher_default();
    Ok(node.create_topic(&parsed, MessageTypeName::new(package, kind), &any)?)
}

/// What is lost comes again, and what finds no room is lost at once: nothing waits.
pub fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .history(History::KeepLast { depth })
}

/// The newest ones, from whoever sends, reliably or not.
pub fn newest(depth: usize) -> QosProfile {
    QosProfile::subscription_default().history(History::KeepLast { depth })
}

/// A name from the root.
pub fn absolute(name: &str) -> String {
    if name.starts_with('/') { name.into() } else { format!("/{name}") }
}
