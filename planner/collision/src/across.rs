//! Which shapes of two arms of one robot are held against each other.

use crate::pairs::Excluded;
use crate::scene::Scene;

/// The pairs of a part that moves with the one arm and a part that moves with the other, as indices
/// into the parts of each; without those that either arm's own list leaves out.
pub(crate) fn across(first: &Scene, second: &Scene) -> Vec<(usize, usize)> {
    let moving = |scene: &Scene| -> Vec<usize> {
        (0..scene.parts.len()).filter(|&part| scene.moves[part]).collect()
    };
    let (own, others) = (moving(first), moving(second));
    let all = own.iter().flat_map(|&a| others.iter().map(move |&b| (a, b)));
    all.filter(|&(a, b)| !is_left_out((first, a), (second, b))).collect()
}

/// Whether one of the lists names both. Each list knows a tool at its own arm's tip alone.
fn is_left_out((first, a): (&Scene, usize), (second, b): (&Scene, usize)) -> bool {
    if first.parts[a].is_pad || second.parts[b].is_pad {
        return false;
    }
    let (one, other) = ((first, a), (second, b));
    let mut lists = first.pairs.excluded.iter().chain(&second.pairs.excluded);
    lists.any(|excluded| names(excluded, one, other) || names(excluded, other, one))
}

fn names(excluded: &Excluded, (one, a): (&Scene, usize), (other, b): (&Scene, usize)) -> bool {
    excluded.first == one.parts[a].name
        && excluded.second == other.parts[b].name
        && excluded.shapes.is_none_or(|shapes| shapes == (shape(one, a), shape(other, b)))
}

/// The how-manieth of its name's shapes a part is.
fn shape(scene: &Scene, part: usize) -> usize {
    let name = &scene.parts[part].name;
    scene.parts[..part].iter().filter(|other| other.name == *name).count()
}
