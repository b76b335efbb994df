//! Which tests share the machine: most run beside each other; those that measure time have it
//! alone.

use std::{
    cell::RefCell,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak},
};

use mtj_protocol::zenoh::threads;

/// Who is on the machine.
struct Occupied {
    beside: usize,
    is_alone: bool,
    waiting_alone: usize,
}

static OCCUPIED: Mutex<Occupied> =
    Mutex::new(Occupied { beside: 0, is_alone: false, waiting_alone: 0 });
static CHANGED: Condvar = Condvar::new();

/// A test's place on the machine, until it is dropped.
pub struct Place {
    is_alone: bool,
}

thread_local! {
    /// The place of the test on this thread: a test takes only one.
    static PLACE: RefCell<Weak<Place>> = const { RefCell::new(Weak::new()) };
}

/// Waits until no test has the machine alone, or waits for that.
pub fn beside_others() -> Arc<Place> {
    take(|| {
        let mut occupied = wait(|occupied| occupied.is_alone || occupied.waiting_alone > 0);
        occupied.beside += 1;
        Place { is_alone: false }
    })
}

/// Waits until no other test runs. A test calls it before anything else.
pub fn alone() -> Arc<Place> {
    take(|| {
        lock().waiting_alone += 1;
        let mut occupied = wait(|occupied| occupied.is_alone || occupied.beside > 0);
        occupied.waiting_alone -= 1;
        occupied.is_alone = true;
        Place { is_alone: true }
    })
}

fn take(place: impl FnOnce() -> Place) -> Arc<Place> {
    // Before any test opens a session of Zenoh: its TLS links are not safe on two threads.
    threads::use_one_thread();
    PLACE.with_borrow_mut(|known| {
        known.upgrade().unwrap_or_else(|| {
            let taken = Arc::new(place());
            *known = Arc::downgrade(&taken);
            taken
        })
    })
}

fn lock() -> MutexGuard<'static, Occupied> {
    OCCUPIED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn wait(is_busy: impl FnMut(&mut Occupied) -> bool) -> MutexGuard<'static, Occupied> {
    CHANGED.wait_while(lock(), is_busy).unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut occupied = lock();
        if self.is_alone {
            occupied.is_alone = false;
        } else {
            occupied.beside -= 1;
        }
        CHANGED.notify_all();
    }
}
