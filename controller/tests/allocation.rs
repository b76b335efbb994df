//! A loop that allocates waits for other threads that do: no law may allocate once it was made.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_protocol::sample::{Header, StateSample, VERSION, padded};

/// The system's allocator, which counts what each thread asks of it.
struct Counting;

thread_local! {
    static ASKED: Cell<u64> = const { Cell::new(0) };
}

fn note() {
    // A thread that is ending has no count any more, and no law.
    let _ = ASKED.try_with(|asked| asked.set(asked.get() + 1));
}

#[expect(unsafe_code, reason = "the trait's methods are unsafe; each hands on what it was given")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note();
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note();
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note();
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        note();
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often `work` asked for memory, or gave some back.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ASKED.get();
    work();
    ASKED.get() - before
}

/// A controller for a bent arm of some links that is two metres long.
fn controller(links: usize, law: &[&str]) -> Controller {
    let length = 2.0 / links as f64;
    let link = format!(
        "{{ length = {length:?}, mass = 2.0, center = {:?}, inertia = 0.1 }}",
        0.5 * length
    );
    let arm = [
        format!("arm.links=[{}]", vec![link; links].join(", ")),
        format!("arm.position={:?}", vec![0.7; links]),
        format!("arm.velocity={:?}", vec![0.0; links]),
    ];
    let sets = arm.iter().map(String::as_str).chain(law.iter().copied());
    let sets: Vec<Override> = sets.map(|set| set.parse().unwrap()).collect();
    let text = built_in("sampled/mtj").unwrap();
    Controller::new(&Scenario::parse("sampled/mtj", text, &sets).unwrap())
}

/// The state of such an arm every 10 ms, with a pause in which commands stayed away.
fn states(links: usize) -> Vec<StateSample> {
    let at = |k: u64| {
        let header = Header {
            version: VERSION,
            joints: links as u32,
            axes: 2,
            sequence: k,
            time_ns: k * 10_000_000,
            ..Header::default()
        };
        let swing = 0.01 * k as f64;
        StateSample {
            header,
            latency_ns: 2_000_000,
            timed_out: u64::from(k == 20),
            position: padded(&vec![0.7 + 0.1 * swing; links]),
            velocity: padded(&vec![0.1 - swing; links]),
            applied: padded(&[1.0, 2.0]),
            delivered: padded(&[1.5, 2.5]),
            ..StateSample::default()
        }
    };
    (0..40).map(at).collect()
}

/// Fails if a law allocates between its first state and its last.
fn assert_free(links: usize, law: &[&str]) {
    let (mut controller, states) = (controller(links, law), states(links));
    let found = allocations(|| {
        for state in &states {
            controller.respond(state).unwrap();
            controller.answer_again(state);
            controller.preprocess(state);
        }
    });
    assert_eq!(found, 0, "{links} links, {law:?}");
}

const PREDICTIONS: [&str; 2] = ["law.prediction.horizon=measured", "law.prediction.horizon=5ms"];

#[test]
fn an_allocation_is_counted() {
    assert_eq!(allocations(|| drop(vec![1_u8; 100])), 2);
    assert_eq!(allocations(|| ()), 0);
}

#[test]
fn tj_allocates_nothing() {
    for links in 2..=7 {
        assert_free(links, &["law.kind=tj"]);
        for prediction in PREDICTIONS {
            assert_free(links, &["law.kind=tj", prediction]);
        }
    }
}

#[test]
fn mtj_allocates_nothing_with_any_factor_memory_or_prediction() {
    for links in 2..=7 {
        for factor in ["constant", "switch", "exponential", "diagonal"] {
            for memory in ["sent", "applied", "delivered"] {
                let factor = format!("law.factor.kind={factor}");
                let memory = format!("law.memory.policy={memory}");
                let law = ["law.kind=mtj", &factor, &memory];
                assert_free(links, &law);
                let step = "law.memory.step=30ms";
                assert_free(links, &[&law[..], &[step, "law.acceleration=true"]].concat());
                for prediction in PREDICTIONS {
                    assert_free(links, &[&law[..], &[prediction]].concat());
                }
            }
        }
    }
}

#[test]
fn mb_allocates_nothing() {
    for scale in ["1.0", "1.1"] {
        let scale = format!("law.model.mass_scale={scale}");
        assert_free(2, &["law.kind=mb", &scale]);
        for prediction in PREDICTIONS {
            assert_free(2, &["law.kind=mb", &scale, prediction]);
        }
    }
}

#[test]
fn tdc_and_eq_11_allocate_nothing_with_any_mass() {
    for links in 2..=7 {
        for mass in ["2.5", "[2, 3]", "[[2, 0.1], [0.1, 3]]", "task-inertia"] {
            let mass = format!("law.mass={mass}");
            assert_free(links, &["law.kind=mtj", "law.acceleration=true", &mass]);
            for memory in ["sent", "applied", "delivered"] {
                let memory = format!("law.memory.policy={memory}");
                let law = ["law.kind=tdc", "law.factor.kind=constant", &mass, &memory];
                assert_free(links, &law);
                for prediction in PREDICTIONS {
                    assert_free(links, &[&law[..], &[prediction]].concat());
                }
            }
        }
    }
}

#[test]
fn the_other_laws_allocate_nothing() {
    for links in 2..=7 {
        for law in [
            "law={kind='dob', kp=8, kd=4, mass=2, filter='20 ms'}",
            "law={kind='impedance', kp=60, kd=120}",
            "law={kind='scct', kp=8, kd=4, inertia=2}",
            "law={kind='pid', kp=100, kd=40, ki=100}",
            "law={kind='rate', kp=4, kd=40, ki=10}",
            "law={kind='adaptive', kp=4, kd=40, adaptation=20, initial='model'}",
        ] {
            assert_free(links, &[law]);
            for prediction in PREDICTIONS {
                assert_free(links, &[law, prediction]);
            }
        }
    }
    assert_free(2, &["law={kind='impedance', kp=60, kd=120, inertia=2}"]);
}

#[test]
fn the_models_prediction_allocates_nothing() {
    for links in 2..=7 {
        for horizon in PREDICTIONS {
            assert_free(links, &["law.kind=mtj", horizon, "law.prediction.model=rigid-body"]);
        }
    }
}
