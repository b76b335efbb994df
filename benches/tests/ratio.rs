//! The paper's claim made physical: mtj costs little more than tj, and the same whatever it remembers.

use std::path::Path;

use mtj_benches::{
    callgrind,
    case::{Case, LINKS, Law, Setting},
    table::Figures,
};

/// Instructions of every loop. Its own process counts under callgrind: see `arithmetic --steps`.
fn loops() -> Figures {
    let cases = Case::all(Setting::loops().chain([Setting::Paper]));
    let program = Path::new(env!("CARGO_BIN_EXE_arithmetic"));
    let counts = callgrind::count(program, &["--steps"], &cases).expect("valgrind counts");
    Figures::new(cases.into_iter().zip(counts))
}

/// What a law may cost of tj, from a measured state to a torque.
fn limit(law: Law, links: usize) -> f64 {
    match (law, links) {
        (Law::MtjSwitch, _) => 1.10,
        // Its two exponentials alone are a tenth of all that tj costs for two links.
        (Law::MtjDiagonal, 2 | 3) => 1.20,
        _ => 1.15,
    }
}

#[test]
fn an_answer_of_mtj_costs_at_most_fifteen_percent_more_instructions_than_one_of_tj() {
    let instructions = loops();
    for setting in Setting::loops() {
        for links in LINKS {
            for law in Law::MTJ {
                let case = Case { setting, links, law };
                let ratio = instructions.ratio(case).expect("a count");
                assert!(ratio <= limit(law, links), "{case}: {ratio:.3} of tj");
                assert!(ratio > 1.0, "{case}: {ratio:.3} of tj, which does less");
            }
        }
    }
}

#[test]
fn counts_are_the_same_each_time() {
    let (one, other) = (loops(), loops());
    for case in Case::all(Setting::loops()) {
        assert_eq!(one.of(case), other.of(case), "{case}");
    }
}
