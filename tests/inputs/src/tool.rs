//! A tool's file.

use nullsweep_robot::Tool;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(bytes) else { return false };
    let Ok(tool) = toml::from_str::<Tool>(text) else { return false };
    let contact = tool.contact_in_tip();
    assert!(contact.translation.vector.iter().all(|x| x.is_finite()), "{tool:?}");
    assert!((contact.rotation.quaternion().norm() - 1.0).abs() < 1e-9, "{tool:?}");
    let again = toml::to_string(&tool).expect("a tool is a table");
    assert_eq!(toml::from_str::<Tool>(&again).expect("what was written"), tool);
    let lengths = [tool.pitch(), tool.inner_radius(), tool.outer_radius(), tool.farthest()];
    assert!(lengths.iter().all(|length| length.is_finite() && *length >= 0.0), "{tool:?}");
    assert!(tool.pitch() > 0.0 && tool.own_speed().is_none_or(|speed| speed > 0.0), "{tool:?}");
    true
}

pub(crate) fn made() -> Vec<Vec<u8>> {
    let shapes = [
        include_str!("../../../docs/tools/finger-pad.toml"),
        include_str!("../../../docs/tools/roller.toml"),
        include_str!("../../../docs/tools/spray-nozzle.toml"),
        include_str!("../../../docs/tools/inspection-camera.toml"),
    ];
    let sponge = toml::to_string(&Tool::default()).expect("a tool is a table");
    shapes.into_iter().map(str::to_owned).chain([sponge]).map(String::into_bytes).collect()
}
