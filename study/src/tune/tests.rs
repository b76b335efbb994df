use super::*;

fn scenario(period: &str) -> Scenario {
    let set = [Override::text("timing.sample_period", period)];
    Scenario::load("sampled/mtj", &set).unwrap()
}

fn wanted(scenario: &Scenario, time_constant_s: f64, latency_s: f64) -> Wanted {
    let motion = limits::motion(scenario, &|| true).unwrap();
    let torque_limit_nm = motion.settled_torque_nm.iter().map(|torque| 1.5 * torque).collect();
    Wanted { time_constant_s, torque_limit_nm, latency_s, sets_latency: true }
}

fn proposals_verify(period: &str) {
    let scenario = scenario(period);
    for latency in [0.0, 0.001, 0.005, 0.02] {
        let wanted = wanted(&scenario, 2.0, latency);
        let proposal = propose(&scenario, &wanted, &|| true).unwrap();
        let values = proposal.values;
        assert!((values.kd / values.kp / 2.0 - 1.0).abs() < 1e-9);
        // Not what the proposal says of itself: the scenario that a user would run.
        let set = values.overrides(&scenario);
        for multiple in [1.0, MARGIN] {
            let trial = trial(&scenario, &wanted, multiple, &set).unwrap();
            let run = verify::run(&trial, &|| true).unwrap();
            assert!(!run.diverged);
            for (peak, limit) in run.peak_torque_nm.iter().zip(&wanted.torque_limit_nm) {
                assert!(peak <= limit, "{latency}: {peak} of {limit}");
            }
        }
        if latency >= 0.001 {
            let (ours, paper) = (proposal.verified.rms(), proposal.as_it_stands.rms());
            assert!(ours < paper, "{period}, {latency}: {ours} for {paper}");
        }
    }
}

#[test]
fn proposals_at_10_ms_verify_and_do_better_than_the_papers_gains() {
    proposals_verify("10 ms");
}

#[test]
fn proposals_at_2_ms_verify_and_do_better_than_the_papers_gains() {
    proposals_verify("2 ms");
}

#[test]
fn the_ratio_of_the_gains_is_the_wanted_time_constant() {
    let scenario = scenario("10 ms");
    for tau in [0.3, 0.7, 3.0] {
        let values = propose(&scenario, &wanted(&scenario, tau, 0.001), &|| true).unwrap().values;
        assert!((values.kd / values.kp / tau - 1.0).abs() < 1e-9);
    }
}

#[test]
fn an_impossible_torque_limit_is_refused_with_a_sentence() {
    let scenario = scenario("10 ms");
    let wanted = Wanted { torque_limit_nm: vec![0.5, 0.5], ..wanted(&scenario, 2.0, 0.0) };
    let failure = propose(&scenario, &wanted, &|| true).unwrap_err();
    assert_eq!(failure.code, 1);
    assert!(failure.sentence.contains("the motion itself takes"), "{failure}");
}
