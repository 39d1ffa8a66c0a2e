//! The real-time thread's heap: whatever it is asked for, blocks are apart, keep what is written into
//! them, and go back to where they came from. Small enough for Miri (with `-Zmiri-tree-borrows`),
//! valgrind and a sanitizer.

#![allow(unsafe_code, reason = "an allocator is asked as a program asks it")]

use std::alloc::{Layout, alloc, dealloc, realloc};
use std::sync::mpsc;
use std::thread;

use nullsweep_executor::PoolAllocator;
use nullsweep_executor::rt::{enter_pool, pool_use};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[global_allocator]
static ALLOCATOR: PoolAllocator = PoolAllocator::new();

/// Requests: few under Miri, which takes a thousand times as long.
const ROUNDS: usize = if cfg!(miri) { 300 } else { 20_000 };
/// The pool's size. \[bytes\]
const SIZE: usize = if cfg!(miri) { 1 << 18 } else { 4 << 20 };

/// A block that was asked for, and the byte that it is full of.
struct Block {
    address: *mut u8,
    layout: Layout,
    mark: u8,
}

impl Block {
    fn new(layout: Layout, mark: u8) -> Self {
        // SAFETY: no layout here is of size 0.
        let address = unsafe { alloc(layout) };
        assert!(!address.is_null() && (address as usize).is_multiple_of(layout.align()));
        let block = Self { address, layout, mark };
        block.fill(0);
        block
    }

    fn fill(&self, from: usize) {
        // SAFETY: the block has that many bytes.
        unsafe { self.address.add(from).write_bytes(self.mark, self.layout.size() - from) };
    }

    fn check(&self) {
        // SAFETY: `fill` has written all of them.
        let bytes = unsafe { std::slice::from_raw_parts(self.address, self.layout.size()) };
        assert!(bytes.iter().all(|byte| *byte == self.mark), "another block wrote into this one");
    }

    fn resize(&mut self, size: usize) {
        self.check();
        let before = self.layout.size();
        // SAFETY: it is a block of this layout, and the size is not 0.
        self.address = unsafe { realloc(self.address, self.layout, size) };
        assert!(!self.address.is_null());
        self.layout = Layout::from_size_align(size, self.layout.align()).unwrap();
        let kept = before.min(size);
        // SAFETY: what was written is kept as far as both sizes go.
        let bytes = unsafe { std::slice::from_raw_parts(self.address, kept) };
        assert!(bytes.iter().all(|byte| *byte == self.mark), "a block lost what was in it");
        self.fill(kept);
    }
}

impl Drop for Block {
    fn drop(&mut self) {
        self.check();
        // SAFETY: it is a block of this layout.
        unsafe { dealloc(self.address, self.layout) };
    }
}

fn layout(random: &mut ChaCha8Rng) -> Layout {
    let size = 1usize << random.random_range(0..if cfg!(miri) { 10 } else { 14 });
    let align = 1usize << random.random_range(0..8);
    Layout::from_size_align(size + random.random_range(0..size), align).unwrap()
}

/// One test: the pool has one thread in a process.
#[test]
fn blocks_are_apart_and_go_back_to_where_they_came_from() {
    // A thread that has not asked is served by the system.
    let outside = pool_use();
    drop(std::hint::black_box(Box::new([0u8; 100])));
    assert_eq!(pool_use().pool_calls, outside.pool_calls);

    let (give, strays) = mpsc::channel::<Box<[u8; 64]>>();
    let owner = thread::spawn(move || {
        enter_pool();
        assert!(pool_use().installed);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut blocks: Vec<Block> = Vec::new();
        for round in 0..ROUNDS {
            let which = random.random_range(0..=blocks.len());
            match random.random_range(0..4) {
                0 if which < blocks.len() => drop(blocks.swap_remove(which)),
                1 if which < blocks.len() => blocks[which].resize(layout(&mut random).size()),
                _ if blocks.len() < 200 => {
                    blocks.push(Block::new(layout(&mut random), round as u8))
                }
                _ => drop(blocks.swap_remove(0)),
            }
        }
        let served = pool_use().pool_calls;
        assert!(served > ROUNDS as u64 / 4, "{served} blocks of the pool");
        blocks.clear();
        // All came back: there is room for one that takes most of it.
        let most = Block::new(Layout::from_size_align(SIZE / 4 * 3, 8).unwrap(), 7);
        assert_eq!(pool_use().pool_calls, served + 1, "what was freed did not come back");
        // What finds no room in it is the system's, and goes back there.
        let more = Block::new(Layout::from_size_align(SIZE / 2, 8).unwrap(), 8);
        assert_eq!(pool_use().pool_calls, served + 1);
        drop((more, most));
        give.send(Box::new([3; 64])).unwrap();
    });
    owner.join().unwrap();
    // Another thread's free of a block of the pool is a leak and nothing worse.
    let before = pool_use().stray_frees;
    let stray = strays.recv().unwrap();
    assert!(stray.iter().all(|byte| *byte == 3));
    drop(stray);
    assert!(pool_use().stray_frees > before);
    // The pool stays with the thread that had it.
    thread::spawn(|| {
        enter_pool();
        let before = pool_use().pool_calls;
        drop(std::hint::black_box(Box::new([0u8; 100])));
        assert_eq!(pool_use().pool_calls, before);
    })
    .join()
    .unwrap();
}
