//! What crosses the boundary, service by service: what two builds must agree on to understand each
//! other's bytes.

use std::string::{String, ToString};

use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use crate::service::{BASE, COMMAND, PLAN, PLAN_EVENT, SETPOINT, STATE, TELEMETRY};
use crate::{
    BaseCommand, BaseStatus, Command, JointStates, Knot, PlanEvent, PlanHeader, Response, Setpoint,
    Telemetry,
};

/// A payload of a service, as its type is named on the wire.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Last part of the service's name.
    pub service: &'static str,
    /// The type's name, with its version.
    pub name: String,
    /// \[bytes\]
    pub size: usize,
}

/// Every payload: what is sent, then what comes with it or is answered.
#[must_use]
pub fn schema() -> [Shape; 10] {
    [
        shape(PLAN.name, TypeDetail::new::<PlanHeader>(TypeVariant::FixedSize)),
        shape(PLAN.name, TypeDetail::new::<Knot>(TypeVariant::Dynamic)),
        shape(SETPOINT.name, TypeDetail::new::<Setpoint>(TypeVariant::FixedSize)),
        shape(STATE.name, TypeDetail::new::<JointStates>(TypeVariant::FixedSize)),
        shape(TELEMETRY.name, TypeDetail::new::<Telemetry>(TypeVariant::FixedSize)),
        shape(PLAN_EVENT.name, TypeDetail::new::<PlanEvent>(TypeVariant::FixedSize)),
        shape(COMMAND, TypeDetail::new::<Command>(TypeVariant::FixedSize)),
        shape(COMMAND, TypeDetail::new::<Response>(TypeVariant::FixedSize)),
        shape(BASE, TypeDetail::new::<BaseCommand>(TypeVariant::FixedSize)),
        shape(BASE, TypeDetail::new::<BaseStatus>(TypeVariant::FixedSize)),
    ]
}

fn shape(service: &'static str, detail: TypeDetail) -> Shape {
    Shape { service, name: detail.type_name().to_string(), size: detail.size() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_payload_has_its_versioned_name_and_size() {
        let all = schema();
        let of = |name: &str| all.iter().find(|shape| shape.name == name).map(|shape| shape.size);
        assert_eq!(of("nullsweep.Telemetry.v5"), Some(size_of::<Telemetry>()));
        assert_eq!(of("nullsweep.Knot.v1"), Some(272));
        for shape in &all {
            let version = shape.name.rsplit('.').next().and_then(|last| last.strip_prefix('v'));
            assert!(version.is_some_and(|v| v.parse::<u32>().is_ok()), "{shape:?}");
        }
    }
}
