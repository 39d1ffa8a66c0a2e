//! A flight recording, run again and read. Its seals are set right first: a forger would know how.

use nullsweep_executor::replay;
use nullsweep_recording::Recording;
use xxhash_rust::xxh3::xxh3_64;

use crate::file;

/// The first bytes of every recording.
const MAGIC: usize = 8;
/// Before each payload: what it is, and its length.
const HEAD: usize = 8;
/// After each payload.
const SEAL: usize = 8;

pub(crate) fn run(bytes: &[u8]) -> bool {
    let raw = file::with(bytes, replay);
    let mut forged = bytes.to_vec();
    seal(&mut forged);
    let sealed = file::with(&forged, replay);
    let read = file::with(&forged, Recording::read);
    raw.is_ok_and(|r| r.setpoints > 0) && sealed.is_ok_and(|r| r.setpoints > 0) && read.is_ok()
}

/// Seals every record as it stands.
fn seal(bytes: &mut [u8]) {
    let mut at = MAGIC;
    while let Some(length) = bytes.get(at + 4..at + HEAD) {
        let length = length.iter().rev().fold(0usize, |n, b| n << 8 | usize::from(*b));
        let end = at.saturating_add(HEAD).saturating_add(length);
        let Some(record) = bytes.get(at..end) else { return };
        let seal = xxh3_64(record).to_le_bytes();
        let Some(place) = bytes.get_mut(end..end + SEAL) else { return };
        place.copy_from_slice(&seal);
        at = end + SEAL;
    }
}
