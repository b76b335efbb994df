//! The memory of a study does not grow with its points.

#![allow(clippy::unwrap_used)] // A test that cannot go on should say so.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
};

use mtj_study::sweep::{
    plan::Plan,
    results::{self, Results, Shard},
    runner,
};

/// The system's allocator, which knows how many bytes are held and how many were at the most.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn take(size: usize) {
    let held = HELD.fetch_add(size, Ordering::Relaxed) + size;
    MOST.fetch_max(held, Ordering::Relaxed);
}

fn give_back(size: usize) {
    HELD.fetch_sub(size, Ordering::Relaxed);
}

#[expect(unsafe_code, reason = "the trait's methods are unsafe; each hands on what it was given")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        take(size);
        give_back(layout.size());
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        give_back(layout.size());
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most bytes that `work` held beyond what was held before.
fn most_held(work: impl FnOnce()) -> usize {
    let before = HELD.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    work();
    MOST.load(Ordering::Relaxed) - before
}

/// A study of `gains` times 100 runs of two samples; where `fails`, every second one cannot be run.
fn plan(gains: usize, fails: bool) -> Plan {
    let seeds: Vec<String> = (0..100).map(|seed| seed.to_string()).collect();
    let step = if fails { r#", "15 ms""# } else { r#", "20 ms""# };
    let text = format!(
        r#"
        scenario = "sampled/mtj"

        [set]
        "duration" = "20 ms"
        "timing.clock" = "lockstep"
        "timing.integration_step" = "auto"
        "bus.kind" = "local"

        [[axes]]
        name = "kd"
        key = "law.kd"
        from = 40.0
        to = 80.0
        count = {gains}

        [[axes]]
        name = "seed"
        key = "seed"
        values = [{}]

        [[axes]]
        name = "step"
        key = "law.memory.step"
        values = ["10 ms"{step}]
        "#,
        seeds.join(", ")
    );
    Plan::parse("memory", &text, &[]).unwrap()
}

fn run(plan: &Plan, folder: &Path, shard: Shard) -> usize {
    let mut results = Results::open(folder, plan, shard).unwrap();
    assert!(runner::run_in_process(plan, &mut results, shard, 1, &|| true).unwrap());
    let failed = results.failures().count();
    results.sort(plan).unwrap();
    failed
}

/// What running, opening, and joining shards held at the most.
fn phases(gains: usize, fails: bool) -> [usize; 3] {
    let name = format!("mtj-memory-{gains}-{}", std::process::id());
    let folder: PathBuf = std::env::temp_dir().join(name);
    let _ = fs::remove_dir_all(&folder);
    let plan = plan(gains, fails);
    let half = |index| Shard { index, of: 2 };
    let mut failed = 0;
    let running = most_held(|| failed = run(&plan, &folder, half(1)));
    failed += run(&plan, &folder, half(2));
    assert_eq!(failed, if fails { plan.len() / 2 } else { 0 });
    let opening = most_held(|| {
        let results = Results::open(&folder, &plan, half(2)).unwrap();
        assert_eq!(results.len(), if fails { 0 } else { plan.len() / 2 });
    });
    if fails {
        run(&plan, &folder, half(2));
    }
    let merging = most_held(|| {
        let merged = results::merge(std::slice::from_ref(&folder), &plan).unwrap();
        assert_eq!((merged.count, merged.missing), (plan.len(), 0));
    });
    let points = results::read(&folder, &plan).unwrap().map(|row| row.unwrap().point);
    assert!(points.eq(0..plan.len()), "the rows are in order");
    fs::remove_dir_all(&folder).unwrap();
    [running, opening, merging]
}

#[test]
fn eight_times_the_points_hold_no_more_bytes_but_a_few_bits_each() {
    for fails in [false, true] {
        let (few, many) = (phases(25, fails), phases(200, fails));
        let more_points = (200 - 25) * 200;
        for (few, many) in few.into_iter().zip(many) {
            let growth = many.saturating_sub(few);
            // Two sets of a bit a point, and the axis of gains itself.
            assert!(growth < 2 * more_points, "{few} bytes became {many}, failing: {fails}");
        }
    }
}
