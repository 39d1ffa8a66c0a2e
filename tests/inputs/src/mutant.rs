//! Mutants of an input: what a fuzzer would try first, the same ones for the same seed.

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What is put where a number stands in a text.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "1e300",
    "-1e300",
    "1e-300",
    "nan",
    "inf",
    "-inf",
    "18446744073709551615",
    "-9223372036854775808",
    "4294967296",
    "1e12",
    "0.5",
    "",
    "x",
];
/// What is put where a word of eight bytes stands.
const WORDS: [u64; 10] = [
    0,
    1,
    u64::MAX,
    1 << 63,
    1 << 32,
    0x7ff0_0000_0000_0000,
    0xfff0_0000_0000_0000,
    0x7ff8_0000_0000_0000,
    0x7fef_ffff_ffff_ffff,
    0x426d_1a94_a200_0000,
];

/// A mutant of an input, 1 to 6 changes from it.
#[must_use]
pub fn mutant(input: &[u8], seed: u64) -> Vec<u8> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut bytes = input.to_vec();
    for _ in 0..random.random_range(1..=6) {
        change(&mut bytes, &mut random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, random: &mut ChaCha8Rng) {
    let length = bytes.len();
    if length == 0 {
        bytes.push(random.random());
        return;
    }
    let at = random.random_range(0..length);
    let end = (at + random.random_range(1..=64)).min(length);
    match random.random_range(0..9) {
        0 => bytes[at] ^= 1 << random.random_range(0..8),
        1 => bytes[at] = random.random(),
        2 => {
            bytes.drain(at..end);
        }
        3 => {
            let part = bytes[at..end].to_vec();
            bytes.splice(at..at, part);
        }
        4 => bytes.truncate(at),
        5 => {
            let word = WORDS.choose(random).copied().unwrap_or_default().to_le_bytes();
            let at = at & !7;
            bytes.iter_mut().skip(at).zip(word).for_each(|(byte, new)| *byte = new);
        }
        6 => {
            let part = bytes[at..end].to_vec();
            let to = random.random_range(0..length);
            bytes.splice(to..to, part);
        }
        _ => number(bytes, at, random),
    }
}

/// Puts another number where the next one stands.
fn number(bytes: &mut Vec<u8>, from: usize, random: &mut ChaCha8Rng) {
    let is_number = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(start) = (from..bytes.len()).find(|&i| bytes[i].is_ascii_digit()) else { return };
    let start = (0..start).rev().take_while(|&i| is_number(&bytes[i])).last().unwrap_or(start);
    let end = (start..bytes.len()).find(|&i| !is_number(&bytes[i])).unwrap_or(bytes.len());
    let new = NUMBERS.choose(random).copied().unwrap_or_default();
    bytes.splice(start..end, new.bytes());
}
