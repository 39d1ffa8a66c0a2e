//! A record: a tag, a length, a payload of plain little-endian bytes and an xxh3 checksum of them. A
//! process that dies leaves at worst a torn last record, which a reader takes as the end.

use xxhash_rust::xxh3::xxh3_64;

/// What a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Tag {
    /// The executor's limits, in a form of its own.
    Guard = 1,
    /// The loop's memory, in a form of its own.
    Checkpoint = 2,
    /// A [`crate::PlanRecord`] and its knots.
    Plan = 3,
    /// A [`crate::CycleRecord`].
    Cycle = 4,
}

/// Appends a sealed record.
pub fn put(to: &mut Vec<u8>, tag: Tag, parts: &[&[u8]]) {
    let start = to.len();
    let length: usize = parts.iter().map(|p| p.len()).sum();
    to.extend_from_slice(&(tag as u32).to_le_bytes());
    to.extend_from_slice(&(length as u32).to_le_bytes());
    for part in parts {
        to.extend_from_slice(part);
    }
    let seal = xxh3_64(&to[start..]);
    to.extend_from_slice(&seal.to_le_bytes());
}

/// Takes the record at the head of `from`; `None` at a torn or false one.
pub fn take<'a>(from: &mut &'a [u8]) -> Option<(Tag, &'a [u8])> {
    let bytes = *from;
    let head = bytes.get(..8)?;
    let number = |b: &[u8]| b.try_into().map(u32::from_le_bytes).ok();
    let tag = match number(&head[..4])? {
        1 => Tag::Guard,
        2 => Tag::Checkpoint,
        3 => Tag::Plan,
        4 => Tag::Cycle,
        _ => return None,
    };
    let end = 8 + number(&head[4..])? as usize;
    let seal = bytes.get(end..end.checked_add(8)?)?;
    if xxh3_64(&bytes[..end]).to_le_bytes() != seal {
        return None;
    }
    *from = &bytes[end + 8..];
    Some((tag, &bytes[8..end]))
}
