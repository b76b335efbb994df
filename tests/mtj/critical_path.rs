//! Nothing is allocated, and the system is not called, from the moment that a state is visible
//! until its torque is, on either end of a loop that spins on shared memory.
//!
//! The loop is the product's own, `serve` and `plant::run`, on threads of this process. A bus that
//! is like any other tells when a sample becomes visible; from then on the thread's allocations are
//! counted, and the kernel hands its system calls to us instead of carrying them out.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    any::Any,
    cell::{Cell, UnsafeCell},
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
    thread,
    time::Instant,
};

use mtj_controller::serve::serve;
use mtj_model::scenario::{BusSettings, Scenario, Wait};
use mtj_plant::plant::{self, Watch};
use mtj_protocol::{
    bus::{Attendance, Bus, BusError, Depth, Offering, Reader, Writer},
    member::{Member, Role},
    port::PlantPort,
    sample::{Sample, StateSample},
    transport::AnyBus,
};
use nix::libc;

use crate::machine;

/// So many samples find each other, follow each other, and map what they need.
const SETTLED: u64 = 200;
const SAMPLES: u64 = 2000;

thread_local! {
    /// What the kernel looks at before it carries out a system call: 0, let it pass; 1, hand it to
    /// us.
    static SELECTOR: UnsafeCell<u8> = const { UnsafeCell::new(0) };
    static IS_CRITICAL: Cell<bool> = const { Cell::new(false) };
}
static SYSTEM_CALLS: AtomicU64 = AtomicU64::new(0);
static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);
static PASSAGES: AtomicU64 = AtomicU64::new(0);

struct Counting;

#[expect(unsafe_code, reason = "an allocator's trait is unsafe to implement; this one only counts")]
// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if IS_CRITICAL.get() {
            ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        }
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        if IS_CRITICAL.get() {
            ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        }
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn select(value: u8) {
    IS_CRITICAL.set(value == 1);
    // The kernel reads it too, so it must really be written now.
    #[expect(unsafe_code, reason = "the kernel reads the byte beside us")]
    // SAFETY: only this thread writes it.
    SELECTOR.with(|selector| unsafe { selector.get().write_volatile(value) });
}

extern "C" fn note_system_call(_signal: libc::c_int) {
    // The return from here is a system call, too.
    select(0);
    SYSTEM_CALLS.fetch_add(1, Ordering::Relaxed);
}

/// From now on this thread's system calls are handed to us while its selector says so.
#[expect(unsafe_code, reason = "there is no safe interface to system call user dispatch")]
fn hand_over_system_calls() {
    const PR_SET_SYSCALL_USER_DISPATCH: libc::c_int = 59;
    const PR_SYS_DISPATCH_ON: libc::c_ulong = 1;
    // SAFETY: the handler touches nothing but two thread-local bytes and an atomic; the selector
    // lives as long as the thread.
    unsafe {
        let handler: extern "C" fn(libc::c_int) = note_system_call;
        assert_ne!(libc::signal(libc::SIGSYS, handler as libc::sighandler_t), libc::SIG_ERR);
        let selector = SELECTOR.with(UnsafeCell::get);
        let nowhere: libc::c_ulong = 0;
        let done = libc::prctl(
            PR_SET_SYSCALL_USER_DISPATCH,
            PR_SYS_DISPATCH_ON,
            nowhere,
            nowhere,
            selector,
        );
        assert_eq!(done, 0, "this test needs Linux 5.11 or later on x86");
    }
}

/// A state is visible, or its torque.
fn passes<S: Sample>(sample: &S) {
    if sample.header().sequence < SETTLED {
        return;
    }
    let is_state = S::TOPIC == StateSample::TOPIC;
    PASSAGES.fetch_add(u64::from(is_state), Ordering::Relaxed);
    select(u8::from(is_state));
}

struct Watched(AnyBus);

struct WatchedEnd<E: ?Sized>(Box<E>);

impl<S: Sample> Writer<S> for WatchedEnd<dyn Writer<S>> {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        self.0.write(sample)
    }
    fn expedite(&mut self, sample: &S) -> Result<(), BusError> {
        self.0.expedite(sample)?;
        passes(sample);
        Ok(())
    }
    fn flush(&mut self) -> Result<(), BusError> {
        self.0.flush()
    }
}

impl<S: Sample> Reader<S> for WatchedEnd<dyn Reader<S>> {
    fn advance(&mut self) -> Result<bool, BusError> {
        let found = self.0.advance()?;
        if found {
            passes(self.0.sample());
        }
        Ok(found)
    }
    fn sample(&self) -> &S {
        self.0.sample()
    }
    fn spin(&mut self) -> Result<bool, BusError> {
        let found = self.0.spin()?;
        if found {
            passes(self.0.sample());
        }
        Ok(found)
    }
    fn sleep(&mut self, until: Instant) -> Result<(), BusError> {
        self.0.sleep(until)
    }
    fn follow(&mut self) -> Result<(), BusError> {
        self.0.follow()
    }
    fn follows(&self) -> bool {
        self.0.follows()
    }
    fn has_more(&self) -> bool {
        self.0.has_more()
    }
    fn malformed(&self) -> u64 {
        self.0.malformed()
    }
}

impl Bus for Watched {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        Ok(Box::new(WatchedEnd(self.0.writer::<S>()?)))
    }
    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        Ok(Box::new(WatchedEnd(self.0.reader::<S>(depth, wait)?)))
    }
    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        self.0.offer(bytes)
    }
    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        self.0.fetch()
    }
    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
        self.0.announce(member)
    }
    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        self.0.attendance()
    }
}

fn join(role: Role) -> Watched {
    let text = format!(
        "kind = 'iceoryx2'\nwait = 'spin'\nsession = 'critical-path-{}'",
        std::process::id()
    );
    let settings = BusSettings::from_table("the test", text.parse().unwrap()).unwrap();
    Watched(AnyBus::open(&settings, role, &|| true).unwrap().unwrap())
}

#[test]
fn nothing_is_allocated_and_no_system_call_made_between_a_state_and_its_torque() {
    let _machine = machine::alone();
    let tdc = ["law.kind=tdc", "law.kp=8", "law.kd=4", "law.mass=task-inertia"];
    for law in [&["law.kind=mtj"][..], &tdc] {
        is_undisturbed(law);
    }
    the_watch_sees_what_it_is_for();
}

fn is_undisturbed(law: &[&str]) {
    let passages = PASSAGES.load(Ordering::Relaxed);
    let set = [
        "bus.wait=spin",
        "timing.clock=lockstep",
        "law.memory.policy=delivered",
        "law.prediction.horizon=measured",
        &format!("duration={} ms", 10 * SAMPLES),
    ];
    let overrides: Vec<_> = set.iter().chain(law).map(|set| set.parse().unwrap()).collect();
    let scenario = Scenario::load("sampled/mtj", &overrides).unwrap();
    let is_over = AtomicBool::new(false);
    let report = thread::scope(|scope| {
        scope.spawn(|| {
            let bus = join(Role::Controller);
            hand_over_system_calls();
            let member = Member::new(Role::Controller, 0);
            serve(&bus, &member, None, &|| !is_over.load(Ordering::Relaxed)).unwrap();
        });
        let plant = scope.spawn(|| {
            let bus = join(Role::Plant);
            let mut port = PlantPort::open(&bus, &scenario, 1).unwrap();
            hand_over_system_calls();
            let watch = Watch { round_trips: true, ..Watch::default() };
            let outcome = plant::run(&scenario, 1, &mut port, watch, &|| true).unwrap();
            select(0);
            outcome.report
        });
        let report = plant.join();
        is_over.store(true, Ordering::Relaxed);
        report.unwrap()
    });
    assert_eq!(report.samples, SAMPLES);
    // Each on either end, and there is no way to count too few without counting too few passages.
    let passages = PASSAGES.load(Ordering::Relaxed) - passages;
    assert!(passages >= 2 * (SAMPLES - SETTLED), "both ends were watched");
    assert_eq!(SYSTEM_CALLS.load(Ordering::Relaxed), 0, "{law:?}: system calls");
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed), 0, "{law:?}: allocations");
}

/// The same watch on something that does both.
fn the_watch_sees_what_it_is_for() {
    let seen = thread::spawn(|| {
        hand_over_system_calls();
        select(1);
        let boxed = std::hint::black_box(Box::new(1));
        let before = (ALLOCATIONS.load(Ordering::Relaxed), SYSTEM_CALLS.load(Ordering::Relaxed));
        #[expect(unsafe_code, reason = "a system call that nobody wraps or remembers")]
        // SAFETY: it has no arguments.
        unsafe {
            libc::syscall(libc::SYS_getppid);
        }
        select(0);
        drop(boxed);
        (before, SYSTEM_CALLS.load(Ordering::Relaxed))
    });
    assert_eq!(seen.join().unwrap(), ((1, 0), 1));
}
