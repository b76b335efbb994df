//! What the laws declare of themselves.

use mtj_model::{
    MAX_AXES, MAX_ECHO, MAX_JOINTS, MAX_SIGNALS,
    law::{LAWS, find},
};

#[test]
fn signals_and_echo_of_every_law_fit_into_a_sample() {
    for law in LAWS {
        for joints in 1..=MAX_JOINTS {
            for axes in 1..=MAX_AXES {
                let signals: usize =
                    law.signals.iter().map(|signal| signal.per.count(joints, axes)).sum();
                let what = format!("{}, {joints} joints, {axes} axes", law.name);
                assert!(signals <= MAX_SIGNALS, "{what}: {signals} signals");
                assert!(law.echo.per.count(joints, axes) <= MAX_ECHO, "{what}: echo");
                let numbers = [0.0; MAX_SIGNALS];
                let cut: usize = law.cut(&numbers, joints, axes).map(|(_, of)| of.len()).sum();
                assert_eq!(cut, signals, "{what}: no signal is cut short");
            }
        }
    }
}

#[test]
fn a_law_is_found_by_its_name_and_no_two_have_the_same() {
    for law in LAWS {
        assert_eq!(find(law.name), Some(*law));
        assert_eq!(LAWS.iter().filter(|other| other.name == law.name).count(), 1, "{}", law.name);
    }
    assert_eq!(find("no such law"), None);
}
