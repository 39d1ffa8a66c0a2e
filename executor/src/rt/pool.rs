//! A heap of the real-time thread's own.
//!
//! iceoryx2 0.10 takes one small block from the heap for each send. The system's heap may take a
//! lock or ask the kernel, so the real-time thread is served from a region that is reserved and
//! touched before the loop starts, by a TLSF allocator: constant time, no lock, no system call.
//! Whatever still enters the system's heap once the loop is armed is counted, and a debug build
//! aborts there.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::{Cell, UnsafeCell};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use rlsf::Tlsf;

/// Room for the ports' bookkeeping (about 300 KiB with every port connected) and the blocks of
/// sends; little under Miri, which keeps a history of each byte. \[bytes\]
const SIZE: usize = if cfg!(miri) { 1 << 18 } else { 4 << 20 };

/// The program's allocator: install it with `#[global_allocator]`. Threads that have not entered
/// the pool get the system's heap.
pub struct PoolAllocator {
    region: UnsafeCell<Region>,
    tlsf: UnsafeCell<Tlsf<'static, u32, u32, 20, 16>>,
    taken: AtomicBool,
}

#[repr(align(4096))]
struct Region {
    #[expect(dead_code, reason = "only its address is used")]
    bytes: [u8; SIZE],
}

// SAFETY: `tlsf` and `region` are touched only by the one thread that has won `taken`, which its
// thread-local mark shows.
unsafe impl Sync for PoolAllocator {}

thread_local! {
    // Constant and without a destructor, so reading them never allocates.
    static MARK: Cell<Mark> = const { Cell::new(Mark::Outside) };
    static ARMED: Cell<bool> = const { Cell::new(false) };
}

static HEAP: AtomicU64 = AtomicU64::new(0);
static POOL: AtomicU64 = AtomicU64::new(0);
static STRAY: AtomicU64 = AtomicU64::new(0);
static INSTALLED: AtomicBool = AtomicBool::new(false);

/// What a thread has to do with the pool.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Outside,
    /// It has asked; its next allocation decides.
    Asking,
    /// The one thread that the pool serves.
    Owner,
}

/// What the pool counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoolUse {
    /// Whether a thread is served from the pool at all.
    pub installed: bool,
    /// Calls of the armed thread that entered the system's heap.
    pub heap_calls: u64,
    /// Blocks that the pool gave.
    pub pool_calls: u64,
    /// Blocks of the pool that other threads tried to free; they are leaked.
    pub stray_frees: u64,
}

/// Serves the calling thread from the pool from now on, as long as it lives. One thread of a
/// process can; without a [`PoolAllocator`] as the program's allocator this does nothing.
pub fn enter_pool() {
    MARK.with(|mark| {
        if mark.get() == Mark::Outside {
            mark.set(Mark::Asking);
            // The allocator itself is out of reach here: let it answer now.
            let _answered = std::hint::black_box(Box::new(0u64));
        }
    });
}

/// Counts every entry of the calling thread into the system's heap from now on; in a debug build
/// such an entry aborts.
pub fn arm(armed: bool) {
    ARMED.with(|mark| mark.set(armed));
}

/// What was counted so far.
#[must_use]
pub fn pool_use() -> PoolUse {
    PoolUse {
        installed: INSTALLED.load(Relaxed),
        heap_calls: HEAP.load(Relaxed),
        pool_calls: POOL.load(Relaxed),
        stray_frees: STRAY.load(Relaxed),
    }
}

impl PoolAllocator {
    /// An empty pool.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            region: UnsafeCell::new(Region { bytes: [0; SIZE] }),
            tlsf: UnsafeCell::new(Tlsf::new()),
            taken: AtomicBool::new(false),
        }
    }

    fn contains(&self, block: *mut u8) -> bool {
        let start = self.region.get() as usize;
        (start..start + SIZE).contains(&(block as usize))
    }

    /// Hands the region to the allocator, if no thread has it yet.
    #[cold]
    fn enter(&self) -> bool {
        let won = !self.taken.swap(true, Relaxed);
        if won {
            // SAFETY: `taken` was false, so this is the only thread that ever comes here, and
            // later use is guarded by its mark. The region is static and used by nothing else.
            unsafe {
                let region = self.region.get().cast::<u8>();
                // Touch every page, so that none faults in the loop.
                for page in (0..SIZE).step_by(4096) {
                    region.add(page).write_volatile(0);
                }
                let block = NonNull::slice_from_raw_parts(NonNull::new_unchecked(region), SIZE);
                (*self.tlsf.get()).insert_free_block_ptr(block);
            }
            INSTALLED.store(true, Relaxed);
        }
        let _ = MARK.try_with(|m| m.set(if won { Mark::Owner } else { Mark::Outside }));
        won
    }

    #[inline]
    fn in_pool(&self) -> bool {
        // A thread that ends has no mark any more.
        match MARK.try_with(Cell::get).unwrap_or(Mark::Outside) {
            Mark::Outside => false,
            Mark::Owner => true,
            Mark::Asking => self.enter(),
        }
    }
}

impl Default for PoolAllocator {
    fn default() -> Self {
        Self::new()
    }
}

// SAFETY: each block comes either from the system's heap or from the region, and goes back to
// where its address says it came from; the pool is used by one thread only.
unsafe impl GlobalAlloc for PoolAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if self.in_pool() {
            // SAFETY: this is the pool's one thread.
            if let Some(block) = unsafe { (*self.tlsf.get()).allocate(layout) } {
                POOL.fetch_add(1, Relaxed);
                return block.as_ptr();
            }
        }
        entered_heap();
        // SAFETY: the caller's contract is the system allocator's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if self.contains(block) {
            if self.in_pool() {
                // The pool's header lies before the block, where the pointer that a `Box` had may
                // not look: so by the region's own.
                let region = self.region.get().cast::<u8>();
                // SAFETY: the block lies in the region, so `allocate` gave it with this
                // alignment, and this is the pool's one thread.
                unsafe {
                    let block = region.add(block as usize - region as usize);
                    (*self.tlsf.get()).deallocate(NonNull::new_unchecked(block), layout.align());
                }
            } else {
                // Another thread must not touch the pool: leaking is the safe end.
                STRAY.fetch_add(1, Relaxed);
            }
            return;
        }
        entered_heap();
        // SAFETY: the block is not the pool's, so it is the system's.
        unsafe { System.dealloc(block, layout) }
    }
}

#[inline]
fn entered_heap() {
    if ARMED.try_with(Cell::get).unwrap_or(false) {
        HEAP.fetch_add(1, Relaxed);
        if cfg!(debug_assertions) {
            // The message itself may allocate.
            arm(false);
            eprintln!("the armed real-time thread entered the system's heap");
            std::process::abort();
        }
    }
}
