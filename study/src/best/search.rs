//! The search for the best gains of many points, side by side.
//!
//! ```text
//! places spread evenly ─▶ short runs ─▶ generations ─▶ the better half, at full length
//!   ─▶ generations ─▶ each key varied ─▶ the best of all, on the scalar path
//! ```
//!
//! A point's result depends on nothing but the point and the seed: each has a population of its
//! own, and a lane's run does not depend on the runs beside it.

use mtj_model::scenario::{Override, Scenario, duration};
use mtj_plant::report::Report;

use super::{
    Found,
    population::Population,
    settings::{Best, Entry},
    verdict::{self, Binding, Verdict},
};
use crate::{
    error::StudyError,
    shell,
    sweep::{lanes, plan::Plan},
    tune,
};

/// The first places, as a multiple of the population.
const SPREAD: usize = 3;
/// Generations of short runs for each key that is searched.
const SHORT: usize = 3;
/// The torque limit of runs of the search, over the limit of the gains.
const SATURATION: f64 = 1.1;
/// The tolerance of short runs, rad and rad/s.
const COARSE: f64 = 1e-6;
/// Generations at full length: so many, and so many more for each key.
const LONG: (usize, usize) = (4, 3);
/// The factors by which each key is varied at the end.
const POLISH: [f64; 3] = [1.06, 1.02, 1.02];
/// How many of the best are tried on the scalar path, at the most.
const VERIFIED: usize = 4;
/// What a limit may be exceeded by on the scalar path: the lanes' integrator is another.
const SLACK: f64 = 1.0 + 1e-3;

/// How long runs are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Long enough to tell the good from the bad.
    Short,
    /// As long as the scenario says.
    Long,
    /// The same as it will be repeated.
    Scalar,
}

/// A point with its search.
struct Problem<'a> {
    plan: &'a Plan,
    best: &'a Best,
    entry: &'a Entry,
    point: usize,
    /// What each run of a candidate sets besides.
    variants: Vec<Vec<Override>>,
    /// What makes the latency as long as the margin asks for; `None` where there is no latency.
    longer: Option<Override>,
    /// What every run of the search sets.
    of_search: Vec<Override>,
    /// What makes a run short and coarse.
    short: Vec<Override>,
    population: Population<Verdict>,
    /// Everything that was tried at full length.
    tried: Vec<(Vec<f64>, Verdict)>,
    /// Why it cannot be searched.
    error: Option<StudyError>,
}

/// A candidate of a problem, and the error that it must be below for its margin to matter, m.
struct Candidate {
    problem: usize,
    at: Vec<f64>,
    below: f64,
}

/// Searches points; `on_result` takes each result. Nothing is said of points that are not finished
/// when `proceed` returns false.
pub(crate) fn measure(
    plan: &Plan,
    best: &Best,
    points: &[usize],
    proceed: &dyn Fn() -> bool,
    on_result: &mut dyn FnMut(usize, Result<Found, StudyError>),
) {
    let mut problems = Vec::new();
    for point in points {
        match Problem::new(plan, best, *point) {
            Ok(problem) => problems.push(problem),
            Err(error) => on_result(*point, Err(error)),
        }
    }
    if search(&mut problems, proceed).is_none() {
        return;
    }
    for problem in problems {
        let point = problem.point;
        if let Some(result) = problem.conclude(proceed) {
            on_result(point, result);
        }
    }
}

/// All stages; `None` if it was interrupted.
fn search(problems: &mut [Problem<'_>], proceed: &dyn Fn() -> bool) -> Option<()> {
    let mut first = Vec::new();
    for (number, problem) in problems.iter().enumerate() {
        first.extend(problem.population.members().iter().map(|(at, _)| Candidate {
            problem: number,
            at: at.clone(),
            below: f64::INFINITY,
        }));
    }
    let mut found = judge(problems, &first, Stage::Short, proceed)?.into_iter();
    for problem in problems.iter_mut() {
        problem.population.found_anew(found.by_ref());
        problem.population.keep(problem.size());
    }
    let dimensions = problems.iter().map(|problem| problem.entry.gains.len()).max().unwrap_or(0);
    for generation in 0..SHORT * dimensions {
        evolve(problems, Stage::Short, proceed, |keys| generation < SHORT * keys)?;
    }
    let mut leading = Vec::new();
    for (number, problem) in problems.iter_mut().enumerate() {
        problem.population.keep(problem.size() / 2);
        leading.extend(problem.population.members().iter().map(|(at, _)| Candidate {
            problem: number,
            at: at.clone(),
            below: f64::INFINITY,
        }));
    }
    let found = judge(problems, &leading, Stage::Long, proceed)?;
    let mut found_of_each = found.iter().copied();
    for problem in problems.iter_mut() {
        problem.population.found_anew(found_of_each.by_ref());
    }
    note(problems, &leading, &found);
    for generation in 0..LONG.0 + LONG.1 * dimensions {
        evolve(problems, Stage::Long, proceed, |keys| generation < LONG.0 + LONG.1 * keys)?;
    }
    POLISH.iter().try_for_each(|factor| polish(problems, *factor, proceed))
}

/// One generation of the problems with so many keys that `takes_part` says so.
fn evolve(
    problems: &mut [Problem<'_>],
    stage: Stage,
    proceed: &dyn Fn() -> bool,
    takes_part: impl Fn(usize) -> bool,
) -> Option<()> {
    let mut candidates = Vec::new();
    for (number, problem) in problems.iter_mut().enumerate() {
        if !takes_part(problem.entry.gains.len()) {
            continue;
        }
        let places = problem.population.offspring();
        let parents = problem.population.members();
        candidates.extend(places.into_iter().zip(parents).map(|(at, (_, parent))| Candidate {
            problem: number,
            at,
            below: if parent.stands() { parent.error } else { f64::INFINITY },
        }));
    }
    let found = judge(problems, &candidates, stage, proceed)?;
    if stage == Stage::Long {
        note(problems, &candidates, &found);
    }
    let mut new: Vec<Vec<(Vec<f64>, Verdict)>> = problems.iter().map(|_| Vec::new()).collect();
    for (candidate, verdict) in candidates.into_iter().zip(found) {
        new[candidate.problem].push((candidate.at, verdict));
    }
    for (problem, new) in problems.iter_mut().zip(new) {
        problem.population.select(new);
    }
    Some(())
}

/// Varies each key of the best candidate of each problem.
fn polish(problems: &mut [Problem<'_>], factor: f64, proceed: &dyn Fn() -> bool) -> Option<()> {
    let mut candidates = Vec::new();
    for (number, problem) in problems.iter().enumerate() {
        let Some((at, verdict)) = problem.leading().first().copied() else { continue };
        for (key, gain) in problem.entry.gains.iter().enumerate() {
            for factor in [factor, 1.0 / factor] {
                let mut varied = at.clone();
                varied[key] = gain.times(varied[key], factor).clamp(0.0, 1.0);
                let below = if verdict.stands() { verdict.error } else { f64::INFINITY };
                candidates.push(Candidate { problem: number, at: varied, below });
            }
        }
    }
    let found = judge(problems, &candidates, Stage::Long, proceed)?;
    note(problems, &candidates, &found);
    Some(())
}

/// Notes what was found at full length.
fn note(problems: &mut [Problem<'_>], candidates: &[Candidate], found: &[Verdict]) {
    for (candidate, verdict) in candidates.iter().zip(found) {
        problems[candidate.problem].tried.push((candidate.at.clone(), *verdict));
    }
}

/// Simulates candidates, all side by side; `None` if it was interrupted.
fn judge(
    problems: &mut [Problem<'_>],
    candidates: &[Candidate],
    stage: Stage,
    proceed: &dyn Fn() -> bool,
) -> Option<Vec<Verdict>> {
    let everyone: Vec<usize> = (0..candidates.len()).collect();
    let reports = simulate(problems, candidates, &everyone, false, stage, proceed)?;
    let mut verdicts: Vec<Verdict> = candidates
        .iter()
        .zip(&reports)
        .map(|(candidate, reports)| {
            Verdict::at_latency(reports, &problems[candidate.problem].best.limits)
        })
        .collect();
    let mut with_margin = Vec::new();
    for (i, (candidate, verdict)) in candidates.iter().zip(&mut verdicts).enumerate() {
        let has_margin = problems[candidate.problem].longer.is_some();
        if verdict.stands() && has_margin && verdict.error < candidate.below {
            with_margin.push(i);
        } else if verdict.stands() && has_margin {
            *verdict = verdict.untried();
        }
    }
    let reports = simulate(problems, candidates, &with_margin, true, stage, proceed)?;
    for (i, reports) in with_margin.into_iter().zip(&reports) {
        let limits = &problems[candidates[i].problem].best.limits;
        verdicts[i] = verdicts[i].with_margin(reports, limits);
    }
    Some(verdicts)
}

/// The reports of all runs of each of some candidates; `None` if it was interrupted.
fn simulate(
    problems: &mut [Problem<'_>],
    candidates: &[Candidate],
    which: &[usize],
    has_margin: bool,
    stage: Stage,
    proceed: &dyn Fn() -> bool,
) -> Option<Vec<Vec<Report>>> {
    let (mut scenarios, mut owners) = (Vec::new(), Vec::new());
    for (place, i) in which.iter().enumerate() {
        let Candidate { problem, at, .. } = &candidates[*i];
        let problem = &mut problems[*problem];
        if problem.error.is_some() {
            continue;
        }
        for variant in 0..problem.variants.len() {
            match problem.scenario(at, variant, has_margin, stage) {
                Ok(scenario) => {
                    scenarios.push(scenario);
                    owners.push(place);
                }
                Err(error) => problem.error = Some(error),
            }
        }
    }
    let mut reports: Vec<Vec<Option<Report>>> = which.iter().map(|_| Vec::new()).collect();
    let mut slots = Vec::with_capacity(owners.len());
    for owner in &owners {
        slots.push(reports[*owner].len());
        reports[*owner].push(None);
    }
    let mut errors = Vec::new();
    lanes::measure(&scenarios, proceed, &mut |number, measured| {
        let owner = owners[number];
        match measured {
            Ok(report) => reports[owner][slots[number]] = Some(report),
            Err(error) => errors.push((owner, error)),
        }
    });
    if !proceed() {
        return None;
    }
    for (owner, error) in errors {
        problems[candidates[which[owner]].problem].error = Some(error);
    }
    Some(reports.into_iter().map(|reports| reports.into_iter().flatten().collect()).collect())
}

impl<'a> Problem<'a> {
    fn new(plan: &'a Plan, best: &'a Best, point: usize) -> Result<Self, StudyError> {
        let entry = plan.law(best, point);
        let (places, random) = Population::<Verdict>::places(
            best.seed,
            SPREAD * best.population * entry.gains.len(),
            entry.gains.len(),
        );
        let nothing = Verdict { error: f64::INFINITY, broken: None };
        let members = places.into_iter().map(|at| (at, nothing)).collect();
        let scenario = plan.scenario_with(point, &entry.middle())?;
        let latency = tune::link_latency(&scenario)?.mean_s;
        let longer = tune::longer(&scenario, (best.limits.margin - 1.0) * latency);
        Ok(Self {
            plan,
            best,
            entry,
            point,
            variants: variants(best, &scenario),
            longer: (latency > 0.0 && best.limits.margin > 1.0).then_some(longer),
            of_search: vec![saturation(best, &scenario)],
            short: vec![
                Override::text("duration", &duration::format(best.short.min(scenario.duration))),
                Override::value("timing.tolerance", coarse(&scenario).into()),
            ],
            population: Population::new(members, random),
            tried: Vec::new(),
            error: None,
        })
    }

    /// How many candidates the population keeps.
    fn size(&self) -> usize {
        self.best.population * self.entry.gains.len()
    }

    /// Everything that a run of a candidate sets beside the plan.
    fn set(&self, at: &[f64], variant: usize) -> Vec<Override> {
        let mut set = self.entry.gains_at(at);
        set.extend(self.variants[variant].iter().cloned());
        set
    }

    fn scenario(
        &self,
        at: &[f64],
        variant: usize,
        has_margin: bool,
        stage: Stage,
    ) -> Result<Scenario, StudyError> {
        let mut set = self.set(at, variant);
        set.extend(self.longer.iter().filter(|_| has_margin).cloned());
        match stage {
            Stage::Short => set.extend(self.of_search.iter().chain(&self.short).cloned()),
            Stage::Long => set.extend(self.of_search.iter().cloned()),
            Stage::Scalar => {}
        }
        Ok(self.plan.scenario_with(self.point, &set)?)
    }

    /// The candidates tried at full length that set different gains, the best first.
    fn leading(&self) -> Vec<(&Vec<f64>, Verdict)> {
        let mut leading: Vec<_> = self.tried.iter().map(|(at, verdict)| (at, *verdict)).collect();
        leading.sort_by(|(_, a), (_, b)| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        leading.dedup_by(|(a, _), (b, _)| self.entry.gains_at(a) == self.entry.gains_at(b));
        leading
    }

    /// The best that stands the test on the scalar path; `None` if it was interrupted.
    fn conclude(mut self, proceed: &dyn Fn() -> bool) -> Option<Result<Found, StudyError>> {
        if let Some(error) = self.error.take() {
            return Some(Err(error));
        }
        let leading = self.leading();
        let first = leading.first().and_then(|(_, verdict)| verdict.broken);
        let mut in_the_way = first.map(|(limit, _)| Binding::Limit(limit));
        let limits = self.best.limits.times(SLACK);
        for (at, verdict) in leading.iter().take(VERIFIED).filter(|(_, found)| found.stands()) {
            let runs = match self.verify(at, false, proceed)? {
                Ok(runs) => runs,
                Err(error) => return Some(Err(error)),
            };
            let mut found = Verdict::at_latency(&runs, &limits);
            let mut error_with_margin = verdict::error(&runs);
            if found.stands() && self.longer.is_some() {
                let runs = match self.verify(at, true, proceed)? {
                    Ok(runs) => runs,
                    Err(error) => return Some(Err(error)),
                };
                found = found.with_margin(&runs, &limits);
                error_with_margin = verdict::error(&runs);
            }
            if let Some((limit, _)) = found.broken {
                in_the_way.get_or_insert(Binding::Limit(limit));
                continue;
            }
            let worst = (0..runs.len())
                .max_by(|a, b| {
                    let error = |run: &usize| runs[*run].rms_error_m.unwrap_or(f64::INFINITY);
                    error(a).total_cmp(&error(b)).then(b.cmp(a))
                })
                .unwrap_or(0);
            let mut set = self.plan.overrides(self.point);
            set.extend(self.set(at, worst));
            return Some(Ok(Found {
                gains: self.entry.gains_at(at),
                command: shell::run_command(&self.plan.scenario, &set),
                report: runs.into_iter().nth(worst),
                margin_rms_error_m: Some(error_with_margin),
                limit: verdict::binding(&self.entry.gains, (at, *verdict), &self.tried),
            }));
        }
        let limit = in_the_way.unwrap_or(Binding::Nothing);
        Some(Ok(Found { limit, ..Found::default() }))
    }

    /// The runs of a candidate on the scalar path; `None` if they were interrupted.
    fn verify(
        &self,
        at: &[f64],
        has_margin: bool,
        proceed: &dyn Fn() -> bool,
    ) -> Option<Result<Vec<Report>, StudyError>> {
        let mut reports = Vec::new();
        for variant in 0..self.variants.len() {
            match self.scenario(at, variant, has_margin, Stage::Scalar) {
                Err(error) => return Some(Err(error)),
                Ok(scenario) => match lanes::reference(&scenario, proceed)? {
                    Err(error) => return Some(Err(error)),
                    Ok(report) => reports.push(report),
                },
            }
        }
        Some(Ok(reports))
    }
}

/// The torque limit of the runs of the search. A candidate that reaches it breaks a limit anyway;
/// without it an arm that whirls around takes most of the time.
fn saturation(best: &Best, scenario: &Scenario) -> Override {
    let own = |joint: usize| {
        let own = scenario.safety.torque_limit.as_ref();
        own.and_then(|own| own.get(joint)).copied().unwrap_or(f64::INFINITY)
    };
    let limit = |joint| own(joint).min(SATURATION * best.limits.torque(joint));
    let limits: Vec<_> =
        (0..scenario.arm.links.len()).map(|i| toml::Value::from(limit(i))).collect();
    Override::value("safety.torque_limit", limits.into())
}

/// The tolerance of short runs.
fn coarse(scenario: &Scenario) -> f64 {
    scenario.timing.tolerance.unwrap_or(COARSE).max(COARSE)
}

/// What each run of a candidate sets besides: every case that matters to the law, from every start.
fn variants(best: &Best, scenario: &Scenario) -> Vec<Vec<Override>> {
    let matters = |set: &Override| {
        let key = set.path();
        let is_own = scenario.law.law.description().parameters.iter().any(|own| own.key == key);
        !key.starts_with("law.") || is_own || scenario.law.balances_gravity(&scenario.arm)
    };
    let mut cases: Vec<Vec<Override>> = Vec::new();
    for case in &best.cases {
        let case: Vec<_> = case.iter().filter(|set| matters(set)).cloned().collect();
        if !cases.contains(&case) {
            cases.push(case);
        }
    }
    let starts = (0..best.starts).map(|start| tune::aside(scenario, start));
    let of_start = |start: Vec<Override>| {
        cases
            .iter()
            .map(move |case| case.iter().chain(&start).cloned().collect())
            .collect::<Vec<_>>()
    };
    starts.flat_map(of_start).collect()
}
