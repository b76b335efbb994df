//! How a role gets a processor to itself, and keeps its memory.
//!
//! If the system refuses, the role logs a warning and continues: its loop is only less punctual.

use std::{
    fs, io,
    sync::{Once, OnceLock},
};

use mtj_model::scenario::{DEFAULT_SPIN, Wait};
use nix::{
    libc,
    sched::{CpuSet, sched_setaffinity},
    sys::mman::{MlockAllFlags, mlockall},
    unistd::Pid,
};

use crate::bus::BusError;

/// Real-time options of a role.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Realtime {
    /// Real-time priority, 1 to 99: nothing of a lower one delays the role (SCHED_FIFO)
    pub priority: Option<u8>,
    /// The processor on which the role's loop stays, counted from 0
    pub cpu: Option<usize>,
    /// Keep the role's memory from being paged out, and fault it in beforehand
    pub lock_memory: bool,
}

impl Realtime {
    /// Applies the options that must precede the joining of a bus.
    pub fn before_joining(&self) {
        allowed();
        if self.lock_memory {
            fault_in_stack();
            // Populates everything that is mapped: the program, its heap, its stack.
            lock(MlockAllFlags::MCL_CURRENT);
        }
    }

    /// Applies the other options, after the role has joined and before its loop begins: joining
    /// takes some ten milliseconds, which must not run at real-time priority.
    pub fn before_the_loop(&self) -> Result<(), BusError> {
        if let Some(priority) = self.priority
            && let Err(error) = set_fifo(priority)
        {
            warn(
                &format!("--priority {priority}"),
                &error,
                "run as root or give it CAP_SYS_NICE (setcap cap_sys_nice+ep), or raise RLIMIT_RTPRIO",
            );
        }
        if self.lock_memory {
            // Most of the shared memory is never used: lock a page of it when it is touched.
            let on_fault = MlockAllFlags::from_bits_retain(libc::MCL_ONFAULT);
            lock(MlockAllFlags::MCL_CURRENT | on_fault);
        }
        let Some(core) = self.cpu else { return Ok(()) };
        let mut cores = CpuSet::new();
        let pinned = cores.set(core).and_then(|()| sched_setaffinity(Pid::from_raw(0), &cores));
        pinned.map_err(|source| BusError::Cpu { core, allowed: allowed(), source })
    }
}

/// How many processors this process could use before it was pinned to one.
fn allowed() -> usize {
    static ALLOWED: OnceLock<usize> = OnceLock::new();
    *ALLOWED.get_or_init(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// How a loop can wait that was asked to wait so: on a single processor a role that spins would keep
/// from running what it waits for.
pub fn affordable(wait: Wait) -> Wait {
    static TOLD: Once = Once::new();
    if wait != Wait::Spin || allowed() > 1 {
        return wait;
    }
    TOLD.call_once(|| {
        tracing::warn!(
            "this process may use one processor only, where spinning would stop the loop: it waits as \
             with bus.wait = \"hybrid\" instead"
        );
    });
    Wait::Hybrid(DEFAULT_SPIN)
}

/// Gives the current thread, which works for a loop but is none, no part of the loop's priority and
/// processor: so that it cannot delay the loop.
pub fn leave_the_loop() {
    // Where it is refused, the thread keeps what it has inherited; it seldom runs.
    let _ = set_scheduler(0, libc::SCHED_OTHER, 0);
    let mut all = CpuSet::new();
    (0..CpuSet::count()).for_each(|core| {
        let _ = all.set(core);
    });
    let _ = sched_setaffinity(Pid::from_raw(0), &all);
}

fn lock(flags: MlockAllFlags) {
    if let Err(error) = mlockall(flags) {
        let remedy = "run as root or give it CAP_IPC_LOCK, or raise RLIMIT_MEMLOCK (ulimit -l)";
        warn("--lock-memory", &error.into(), remedy);
    }
}

fn warn(option: &str, error: &io::Error, remedy: &str) {
    tracing::warn!("{option} was refused ({error}) and the loop goes on without; {remedy}");
}

/// Sets the priority of all threads of this process, those of the bus included; their children
/// inherit it.
fn set_fifo(priority: u8) -> io::Result<()> {
    for thread in fs::read_dir("/proc/self/task")? {
        let thread = thread?.file_name().to_str().and_then(|name| name.parse().ok());
        let set = |thread| set_scheduler(thread, libc::SCHED_FIFO, priority);
        match thread.map_or(Ok(()), set) {
            // The thread has ended meanwhile.
            Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
            result => result?,
        }
    }
    Ok(())
}

#[expect(unsafe_code, reason = "nix wraps the scheduler's affinity, but not its policy")]
fn set_scheduler(thread: libc::pid_t, policy: libc::c_int, priority: u8) -> io::Result<()> {
    let parameters = libc::sched_param { sched_priority: priority.into() };
    // SAFETY: the parameters outlive the call, which only reads them.
    match unsafe { libc::sched_setscheduler(thread, policy, &raw const parameters) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Touches more of the stack than the loop uses.
#[inline(never)]
fn fault_in_stack() {
    std::hint::black_box([0_u8; 256 * 1024]);
}
