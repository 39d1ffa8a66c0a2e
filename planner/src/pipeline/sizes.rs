//! Sizes of patches and of the graph that follow from the tool: the paper's ε depends on it.

use nullsweep_robot::Tool;
use nullsweep_surface::PatchConfig;

use crate::roadmap::GraphConfig;

/// Least radius of a patch's neighbourhood, and most: a tool that touches lies on no larger one, as
/// that would not be level. \[m\]
const RADIUS: (f64, f64) = (0.010, 0.12);
/// Share of the distance in which a tool works from afar that a patch may be uneven.
const UNEVEN: f64 = 0.5;

/// How large what a tool works on is, beside the sponge for which the defaults are.
fn scale(tool: &Tool) -> f64 {
    let side = |tool: &Tool| {
        let [across, along] = tool.track();
        (across * along).sqrt()
    };
    let (scale, epsilon) = (side(tool) / side(&Tool::default()), PatchConfig::default().epsilon);
    let most = if tool.touches() { 1.0 } else { RADIUS.1 / epsilon };
    scale.clamp(RADIUS.0 / epsilon, most)
}

/// How patches are found for a tool.
#[must_use]
pub fn patches(tool: &Tool) -> PatchConfig {
    let own = PatchConfig::default();
    let epsilon = own.epsilon * scale(tool);
    if tool.touches() {
        return PatchConfig { epsilon, ..own };
    }
    let [near, far] = tool.distance();
    let depth = UNEVEN * (tool.stand_off - near).min(far - tool.stand_off);
    let uneven = (depth / own.inlier_distance).clamp(1.0, scale(tool).max(1.0));
    PatchConfig {
        epsilon,
        inlier_distance: own.inlier_distance * uneven,
        max_rmse: own.max_rmse * uneven,
        ..own
    }
}

/// How the graph is built for a tool.
#[must_use]
pub fn graph(tool: &Tool) -> GraphConfig {
    let (own, scale) = (GraphConfig::default(), scale(tool));
    GraphConfig { radius: own.radius * scale, line_step: own.line_step * scale, ..own }
}

#[cfg(test)]
mod tests {
    use nullsweep_robot::{Camera, Footprint};

    use super::*;

    #[test]
    fn sizes_follow_from_the_tool_and_are_the_defaults_for_the_sponge() {
        let sponge = Tool::default();
        assert_eq!((patches(&sponge), graph(&sponge)), Default::default());
        let finger = Tool { length: 0.03, width: 0.03, ..sponge.clone() };
        assert!((0.012..0.016).contains(&patches(&finger).epsilon));
        assert!((0.03..0.04).contains(&graph(&finger).radius));
        let tip = Tool { length: 0.005, width: 0.005, ..sponge.clone() };
        assert_eq!(patches(&tip).epsilon, RADIUS.0);
        let board = Tool { length: 0.5, width: 0.3, ..sponge.clone() };
        assert_eq!(patches(&board), PatchConfig::default());
        let camera = Camera { distance: [0.3, 0.5], field_of_view: [0.8, 0.6] };
        let camera = Tool { stand_off: 0.4, footprint: Footprint::Camera(camera), ..sponge };
        assert!(patches(&camera).epsilon > 0.1 && graph(&camera).radius > 0.25);
        assert!(patches(&camera).inlier_distance > 0.02);
    }
}
