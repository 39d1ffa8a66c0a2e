//! A recording made on a virtual clock, replayed whole and tampered with.

use bytemuck::Zeroable;
use nullsweep_ipc_types::{EventKind, JoinRule, JointStates, status};
use nullsweep_recording::{CycleRecord, MAGIC, Tag, put, take};

use super::{Recorder, ReplayError, replay};
use crate::guard::tests::pr2;
use crate::rt::Wake;
use crate::testing::{HOME, MS, moved, plan};
use crate::{Driver, Loopback, Slots};

#[test]
fn what_an_executor_before_has_recorded_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let begin = || drop(Recorder::new(folder.path(), 1 << 20, pr2()).unwrap());
    std::fs::write(at("flight-0.nswrec"), "first").unwrap();
    std::fs::write(at("flight-1.nswrec"), "second").unwrap();
    begin();
    assert!(!at("flight-0.nswrec").exists());
    assert_eq!(std::fs::read(at("before-0.nswrec")).unwrap(), b"first");
    assert_eq!(std::fs::read(at("before-1.nswrec")).unwrap(), b"second");
    // One that recorded nothing takes nothing away.
    begin();
    assert!(at("before-0.nswrec").exists() && at("before-1.nswrec").exists());
    // Parts of two executors do not stand beside each other.
    std::fs::write(at("flight-0.nswrec"), "third").unwrap();
    begin();
    assert_eq!(std::fs::read(at("before-0.nswrec")).unwrap(), b"third");
    assert!(!at("before-1.nswrec").exists());
}

#[test]
fn a_setpoint_that_differs_in_one_bit_is_found() {
    let folder = tempfile::TempDir::new().unwrap();
    let guard = pr2();
    let (mut recorder, tape) = Recorder::new(folder.path(), 1 << 30, guard).unwrap();
    let mut states = JointStates {
        joint_count: 7,
        status: status::CALIBRATED,
        stamp_ns: 1,
        ..JointStates::zeroed()
    };
    states.positions[..8].copy_from_slice(&HOME[..]);
    let Slots { looping, mut worker, service: _service } = Slots::default();
    let mut driver = Driver::new(Loopback::new(states, 2), guard, looping);
    driver.record(tape);
    for cycle in 1..=400u64 {
        if cycle == 50 {
            let points = [(0, HOME), (200 * MS, moved(HOME, 0, 0.2))];
            let plan = plan(&guard, 1, JoinRule::StopThenStart, &points);
            recorder.plan(&plan);
            worker.offers.push(plan).unwrap();
        }
        driver.cycle(Wake { deadline_ns: cycle * MS, now_ns: cycle * MS + 3, missed: 0 });
        recorder.round().unwrap();
    }
    recorder.finish().unwrap();
    let file = folder.path().join("flight-0.nswrec");
    let replayed = replay(&file).unwrap();
    // The first cycle makes the checkpoint that the recording begins with.
    assert_eq!((replayed.cycles, replayed.torn), (399, 0));
    assert_eq!(replayed.count(EventKind::Finished), 1);

    let bytes = std::fs::read(&file).unwrap();
    let mut rest = bytes.strip_prefix(MAGIC).unwrap();
    let mut forged = MAGIC.to_vec();
    let mut cycles = 0;
    while let Some((tag, payload)) = take(&mut rest) {
        cycles += usize::from(tag == Tag::Cycle);
        if tag == Tag::Cycle && cycles == 120 {
            let mut record: CycleRecord = bytemuck::pod_read_unaligned(payload);
            record.target.q[0] = f64::from_bits(record.target.q[0].to_bits() ^ 1);
            put(&mut forged, tag, &[bytemuck::bytes_of(&record)]);
        } else {
            put(&mut forged, tag, &[payload]);
        }
    }
    std::fs::write(&file, forged).unwrap();
    let found = replay(&file).unwrap_err();
    assert!(matches!(found, ReplayError::Differs { cycle: 120, .. }), "{found}");
}
