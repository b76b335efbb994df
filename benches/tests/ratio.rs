//! The paper's claim made physical: mtj costs little more than tj, whatever it remembers.

use std::path::Path;

use mtj_benches::{
    callgrind,
    case::{Case, LINKS, Setting},
    law::Law,
    table::Figures,
};

/// Instructions of every loop. Its own process counts under callgrind: see `arithmetic --steps`.
fn loops() -> Figures {
    let cases = Case::all(Setting::loops().chain([Setting::Paper]));
    let program = Path::new(env!("CARGO_BIN_EXE_arithmetic"));
    let counts = callgrind::count(program, &["--steps"], &cases).expect("valgrind counts");
    Figures::new(cases.into_iter().zip(counts))
}

#[test]
fn an_answer_of_mtj_costs_at_most_fifteen_percent_more_instructions_than_one_of_tj() {
    let instructions = loops();
    let laws = [Law::MtjSwitch, Law::MtjExponential, Law::MtjDiagonal];
    for setting in Setting::loops() {
        for (links, law) in LINKS.flat_map(|links| laws.iter().map(move |law| (links, *law))) {
            let case = Case { setting, links, law };
            let ratio = instructions.ratio(case).expect("a count");
            assert!(ratio <= 1.15, "{case}: {ratio:.3} of tj");
            assert!(ratio > 1.0, "{case}: {ratio:.3} of tj, which does less");
        }
    }
}

/// Instructions of an answer of tj for two to seven links as they were recorded, on x86-64 with
/// glibc 2.36.
const RECORDED: [f64; 6] = [902.0, 1039.0, 1187.0, 1340.0, 1504.0, 1627.0];
/// What another compiler, C library or processor may make of it. A regression is a copy or a sine
/// too many.
const ALLOWANCE: f64 = 1.25;

#[test]
#[cfg_attr(not(target_arch = "x86_64"), ignore = "recorded on x86-64")]
fn an_answer_costs_about_as_many_instructions_as_it_did() {
    let instructions = loops();
    for (links, recorded) in LINKS.zip(RECORDED) {
        let case = Case { setting: Setting::LOOP, links, law: Law::Tj };
        let count = instructions.of(case).expect("a count");
        assert!(count < ALLOWANCE * recorded, "{case}: {count}, recorded {recorded}");
    }
}

#[test]
fn counts_are_the_same_each_time() {
    let (one, other) = (loops(), loops());
    for case in Case::all(Setting::loops()) {
        assert_eq!(one.of(case), other.of(case), "{case}");
    }
}
