//! Recordings whose seals are right and whose content is anything: replaying one ends with an
//! answer, never in a panic. The loop's own function is what replays them.

use std::io::Write as _;
use std::sync::Arc;

use nullsweep_ipc_types::JoinRule;
use nullsweep_recording::{MAGIC, PlanRecord, Tag, put, take};
use proptest::prelude::*;

use super::format::{self, GuardRecord};
use super::replay;
use crate::cycle::{Ask, Checkpoint, Input, Measured, Order, State, step};
use crate::guard::tests::pr2;
use crate::testing::{HOME, MS, moved, plan};

/// What a forger would write where a number stands.
const ODD: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    -1.0,
    0.0,
    1.0,
    1e15,
    -1e200,
    1e-300,
];

/// A sound recording: a connector, a plan, a pause, a resume, a stop, a reset.
fn sound() -> Vec<u8> {
    let guard = pr2();
    let mut state = State::default();
    let mut cycles = Vec::new();
    let mut bytes = MAGIC.to_vec();
    put(&mut bytes, Tag::Guard, &[bytemuck::bytes_of(&GuardRecord::from(&guard))]);
    let checkpoint: Checkpoint = state.checkpoint().unwrap();
    put(&mut bytes, Tag::Checkpoint, &[bytemuck::bytes_of(&checkpoint)]);
    let points = [(0, moved(HOME, 0, 0.01)), (200 * MS, moved(HOME, 0, 0.2))];
    let offer = plan(&guard, 1, JoinRule::StopThenStart, &points);
    let knots = bytemuck::cast_slice(offer.knots());
    put(&mut bytes, Tag::Plan, &[bytemuck::bytes_of(&PlanRecord::from(&*offer)), knots]);
    for cycle in 1..=60u64 {
        let now_ns = cycle * MS;
        let q = state.snapshot().commanded;
        let order = match cycle {
            30 => Some(Order::Pause),
            35 => Some(Order::Resume),
            40 => Some(Order::Speed(0.5)),
            50 => Some(Order::Stop),
            55 => Some(Order::Reset),
            _ => None,
        };
        let input = Input {
            measured: Some(Measured {
                stamp_ns: now_ns,
                setpoint_sequence: state.sequence(),
                joint_count: guard.dof,
                q: if cycle == 1 { HOME } else { q },
                status: nullsweep_ipc_types::status::CALIBRATED,
            }),
            ask: order.map(|order| Ask { ticket: cycle, order }),
            offer: (cycle == 5).then(|| Arc::clone(&offer)),
            missed: 0,
        };
        let mut record = format::cycle(&input, now_ns);
        let setpoint = step(&mut state, input, now_ns, &guard).setpoint;
        record.target = format::target(setpoint.as_ref());
        cycles.push(record);
    }
    for record in &cycles {
        put(&mut bytes, Tag::Cycle, &[bytemuck::bytes_of(record)]);
    }
    bytes
}

/// One word of a record's payload: which record, which word, and what it becomes.
type Forgery = (usize, usize, u64);

fn forged(sound: &[u8], forgeries: &[Forgery]) -> Vec<u8> {
    let mut rest = sound.strip_prefix(MAGIC).unwrap();
    let mut bytes = MAGIC.to_vec();
    let mut record = 0;
    while let Some((tag, payload)) = take(&mut rest) {
        let mut payload = payload.to_vec();
        for (_, word, value) in forgeries.iter().filter(|f| f.0 == record) {
            let at = word % (payload.len() / 8) * 8;
            payload[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        put(&mut bytes, tag, &[&payload]);
        record += 1;
    }
    bytes
}

fn replayed(bytes: &[u8]) -> bool {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(bytes).unwrap();
    replay(file.path()).is_ok()
}

/// The fuzzer begins with a recording of this version: where the format has changed, it is to be
/// written anew.
#[test]
fn the_fuzzers_seed_is_of_this_version() {
    let path =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/inputs/corpus/recording/sound.nswrec");
    // Guard, checkpoint, plan and some cycles: the plan is taken in the fifth.
    let whole = sound();
    let mut rest = whole.strip_prefix(MAGIC).unwrap();
    (0..12).for_each(|_| assert!(take(&mut rest).is_some()));
    let short = &whole[..whole.len() - rest.len()];
    if std::env::var_os("NULLSWEEP_WRITE_SEED").is_some() {
        std::fs::write(path, short).unwrap();
    }
    let seed = std::fs::read(path).unwrap_or_default();
    assert!(seed == short, "another format: run this test once with NULLSWEEP_WRITE_SEED=1");
    assert!(replayed(&seed));
}

#[test]
fn any_word_of_a_recording_may_be_any_number() {
    let sound = sound();
    assert!(replayed(&sound));
    // The guard: 3 + 48 + 12 words. A checkpoint's first 40, and the plan.
    for (record, words) in [(0, 70), (1, 60), (2, 46)] {
        for word in 0..words {
            for odd in ODD.map(f64::to_bits).into_iter().chain([u64::MAX, 1 << 32, 7]) {
                replayed(&forged(&sound, &[(record, word, odd)]));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_forged_recording_never_panics(
        forgeries in prop::collection::vec(
            (
                prop_oneof![4 => 0usize..3, 1 => 3usize..63],
                0usize..100,
                prop_oneof![any::<u64>(), prop::sample::select(&ODD[..]).prop_map(f64::to_bits)],
            ),
            1..8,
        ),
    ) {
        let sound = sound();
        replayed(&forged(&sound, &forgeries));
    }
}
