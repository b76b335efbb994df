//! Table 1, counted by running the laws on numbers that count their operations.
//!
//! As in the paper N = M, all matrices are full, the tracking error is given, and for mb so are the
//! inverse Jacobian and H, C. A step is the law's task force and then τ = Jᵀ Q̂.

use std::fmt;

use mtj_model::{
    JointCount,
    arm::TaskDynamics,
    for_joints,
    gains::Gains,
    law::{
        factor::{Factor, FactorKind, Thresholds},
        mb::ModelBased,
        mtj::ModifiedTransposeJacobian,
        tj::TransposeJacobian,
    },
    matrix,
    task::TrackingError,
};
use nalgebra::{SMatrix, SVector};
use serde::Serialize;

use super::{
    comparison::printed_width,
    counting::{Counted, Operations, count},
};

/// The sizes that are counted.
pub(crate) const SIZES: std::ops::RangeInclusive<u64> = 2..=7;

/// The operations of one step of each law at one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Counts {
    /// Joints and task axes.
    pub n: u64,
    /// tj.
    pub tj: Operations,
    /// mtj with the switch (14).
    pub mtj_switch: Operations,
    /// mtj with the exponential of the norms (15a).
    pub mtj_exponential: Operations,
    /// mtj with an exponential for each axis (15b).
    pub mtj_diagonal: Operations,
    /// The two norms ‖e‖ and ‖ė‖, which (14) and (15a) contain.
    pub norms: Operations,
    /// mb from the vector J̇ q̇.
    pub mb: Operations,
    /// The product of J̇ and q̇.
    pub jacobian_rate_times_velocity: Operations,
}

/// A formula that the paper prints, or one like it.
pub(crate) struct Formula {
    /// As text.
    pub text: &'static str,
    /// Its value at a size.
    pub at: fn(u64) -> u64,
}

/// The printed formulas.
pub(crate) mod printed {
    use super::Formula;

    /// Multiplications of tj, Table 1.
    pub(crate) const TJ_MULTIPLICATIONS: Formula = Formula { text: "3N²", at: |n| 3 * n * n };
    /// Additions of tj, Table 1.
    pub(crate) const TJ_ADDITIONS: Formula =
        Formula { text: "3N²−2N", at: |n| 3 * n * n - 2 * n };
    /// Multiplications of mtj, Table 1.
    pub(crate) const MTJ_MULTIPLICATIONS_TABLE: Formula =
        Formula { text: "3N²+2", at: |n| 3 * n * n + 2 };
    /// Multiplications of mtj, text below eq. (17).
    pub(crate) const MTJ_MULTIPLICATIONS_TEXT: Formula =
        Formula { text: "3N²+N+2", at: |n| 3 * n * n + n + 2 };
    /// Additions of mtj, Table 1 and text.
    pub(crate) const MTJ_ADDITIONS: Formula =
        Formula { text: "3N²−N+1", at: |n| 3 * n * n - n + 1 };
    /// Multiplications of mb, Table 1.
    pub(crate) const MB_MULTIPLICATIONS: Formula =
        Formula { text: "2N³+7N²", at: |n| 2 * n * n * n + 7 * n * n };
    /// Additions of mb, Table 1.
    pub(crate) const MB_ADDITIONS: Formula =
        Formula { text: "2N³+5N²−4N", at: |n| 2 * n * n * n + 5 * n * n - 4 * n };
}

impl Counts {
    /// mtj (15a) without the work in the two norms, which the paper leaves out.
    pub(crate) fn mtj_without_norms(&self) -> Operations {
        let (all, norms) = (self.mtj_exponential, self.norms);
        Operations {
            multiplications: all.multiplications - norms.multiplications,
            divisions: all.divisions,
            additions: all.additions - norms.additions,
            functions: all.functions - norms.functions,
        }
    }

    /// mb with the product of J̇ and q̇ included.
    pub(crate) fn mb_from_jacobian_rate(&self) -> Operations {
        self.mb + self.jacobian_rate_times_velocity
    }
}

/// Counts every law at every size.
pub(crate) fn count_all() -> Vec<Counts> {
    SIZES
        .filter_map(|n| JointCount::new(n as usize))
        .map(|joints| for_joints!(joints, N => count_at::<N>()))
        .collect()
}

fn count_at<const N: usize>() -> Counts {
    let vector = |seed: f64| SVector::<Counted, N>::from_fn(|i, _| Counted(seed + 0.1 * i as f64));
    let full = |seed: f64| {
        SMatrix::<Counted, N, N>::from_fn(|i, j| Counted(seed + 0.3 * i as f64 - 0.2 * j as f64))
    };
    let (kp, kd) = (Gains::Full(full(30.0)), Gains::Full(full(60.0)));
    let error = TrackingError { position: vector(0.01), velocity: vector(0.02) };
    let (jacobian, remembered) = (full(0.7), vector(5.0));
    let step = |task_force: &dyn Fn() -> SVector<Counted, N>| {
        count(|| matrix::transpose_times(&jacobian, &task_force())).1
    };

    let tj = TransposeJacobian { kp, kd };
    let with_factor = |kind| {
        let thresholds = Thresholds::Same(Counted(10.0), Counted(100.0));
        let factor = Factor { kind, thresholds, ceiling: None };
        let law = ModifiedTransposeJacobian { tj, factor, acceleration: None };
        step(&|| law.task_force(&error, Some(&remembered), None).force)
    };
    let mb = ModelBased { kp, kd };
    let (inertia, terms, inverse) = (full(4.0), vector(0.4), full(0.9));
    let (jacobian_rate, velocity) = (full(0.2), vector(1.5));
    let (rate_velocity, jacobian_rate_times_velocity) =
        count(|| matrix::times(&jacobian_rate, &velocity));
    let desired_acceleration = vector(0.5);
    let norms = count(|| (matrix::norm(&error.position), matrix::norm(&error.velocity))).1;
    Counts {
        n: N as u64,
        tj: step(&|| tj.task_force(&error)),
        mtj_switch: with_factor(FactorKind::Switch),
        mtj_exponential: with_factor(FactorKind::Exponential),
        mtj_diagonal: with_factor(FactorKind::Diagonal),
        norms,
        mb: step(&|| {
            let dynamics = TaskDynamics::new(&inertia, &terms, &inverse, &rate_velocity);
            mb.task_force(&error, &desired_acceleration, &dynamics)
        }),
        jacobian_rate_times_velocity,
    }
}

/// Findings about the printed formulas.
pub(crate) const FINDINGS: [&str; 4] = [
    "TJ: counted and printed are equal at every N.",
    "MTJ: with k of (15a), and with divisions counted as multiplications, the count is 3N²+N+2, the \
     text's formula, once the norms' own 2N multiplications and 2N−2 additions are set aside: k \
     times a vector costs N, the two divisions by the thresholds are the +2, and adding the two \
     ratios is the +1 among the additions. Table 1's 3N²+2 leaves out the N of k times the memory.",
    "MTJ: the switch (14) needs no multiplication by k and no division, but the norms; (15b) needs \
     no norms, but 2N divisions and N exponentials.",
    "MB: our law takes J̇q̇ as one vector, which saves N² multiplications; with that product the \
     multiplications are the printed ones and the additions are N more than printed, since eqs. (3b) \
     and (4) contain four sums of vectors, 4N additions, of which the printed formula has three.",
];

/// Table 1 for people.
pub(crate) struct Table1<'a>(pub &'a [Counts]);

impl fmt::Display for Table1<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut row = |name: &str, value: &dyn Fn(&Counts) -> u64| {
            let padding = " ".repeat(54_usize.saturating_sub(printed_width(name)));
            write!(f, "  {name}{padding}")?;
            self.0.iter().try_for_each(|counts| write!(f, "{:>6}", value(counts)))?;
            writeln!(f)
        };
        let print = |formula: Formula| move |counts: &Counts| (formula.at)(counts.n);
        row("N = M", &|c| c.n)?;
        row("TJ   multiplications, printed 3N²", &print(printed::TJ_MULTIPLICATIONS))?;
        row("                      counted", &|c| c.tj.multiplications)?;
        row("     additions, printed 3N²−2N", &print(printed::TJ_ADDITIONS))?;
        row("                counted", &|c| c.tj.additions)?;
        row(
            "MTJ  multiplications, printed in Table 1, 3N²+2",
            &print(printed::MTJ_MULTIPLICATIONS_TABLE),
        )?;
        row(
            "                      printed in the text, 3N²+N+2",
            &print(printed::MTJ_MULTIPLICATIONS_TEXT),
        )?;
        row("     (15a)            counted, with ÷, without norms", &|c| {
            c.mtj_without_norms().multiplications + c.mtj_without_norms().divisions
        })?;
        row("                      counted, all", &|c| c.mtj_exponential.multiplications)?;
        row("                      of which in the norms", &|c| c.norms.multiplications)?;
        row("                      and divisions", &|c| c.mtj_exponential.divisions)?;
        row("     additions, printed 3N²−N+1", &print(printed::MTJ_ADDITIONS))?;
        row("     (15a)      counted, without norms", &|c| c.mtj_without_norms().additions)?;
        row("                counted, all", &|c| c.mtj_exponential.additions)?;
        row("                of which in the norms", &|c| c.norms.additions)?;
        row("     (14)  multiplications counted, all in TJ and norms", &|c| {
            c.mtj_switch.multiplications
        })?;
        row("           additions counted", &|c| c.mtj_switch.additions)?;
        row("     (15b) multiplications counted", &|c| c.mtj_diagonal.multiplications)?;
        row("           and divisions", &|c| c.mtj_diagonal.divisions)?;
        row("           additions counted", &|c| c.mtj_diagonal.additions)?;
        row("MB   multiplications, printed 2N³+7N²", &print(printed::MB_MULTIPLICATIONS))?;
        row("                      counted, with J̇ times q̇", &|c| {
            c.mb_from_jacobian_rate().multiplications
        })?;
        row("                      counted", &|c| c.mb.multiplications)?;
        row("     additions, printed 2N³+5N²−4N", &print(printed::MB_ADDITIONS))?;
        row("                counted, with J̇ times q̇", &|c| {
            c.mb_from_jacobian_rate().additions
        })?;
        row("                counted", &|c| c.mb.additions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tj_costs_exactly_what_table_1_prints_at_every_size() {
        for counts in count_all() {
            assert_eq!(counts.tj.multiplications, (printed::TJ_MULTIPLICATIONS.at)(counts.n));
            assert_eq!(counts.tj.additions, (printed::TJ_ADDITIONS.at)(counts.n));
            assert_eq!(counts.tj.divisions + counts.tj.functions, 0);
        }
    }

    #[test]
    fn mtj_costs_what_the_text_prints_and_not_what_table_1_prints() {
        for counts in count_all() {
            let done = counts.mtj_without_norms();
            let multiplications = done.multiplications + done.divisions;
            assert_eq!(multiplications, (printed::MTJ_MULTIPLICATIONS_TEXT.at)(counts.n));
            assert_ne!(multiplications, (printed::MTJ_MULTIPLICATIONS_TABLE.at)(counts.n));
            assert_eq!(done.divisions, 2);
            assert_eq!(done.additions, (printed::MTJ_ADDITIONS.at)(counts.n));
            assert_eq!(counts.norms.multiplications, 2 * counts.n);
        }
    }

    #[test]
    fn the_switch_multiplies_only_in_tj_and_norms() {
        for counts in count_all() {
            let expected = counts.tj.multiplications + counts.norms.multiplications;
            assert_eq!(counts.mtj_switch.multiplications, expected);
            assert_eq!(counts.mtj_switch.divisions, 0);
        }
    }

    #[test]
    fn mb_costs_the_printed_multiplications_and_n_more_additions() {
        for counts in count_all() {
            let done = counts.mb_from_jacobian_rate();
            assert_eq!(done.multiplications, (printed::MB_MULTIPLICATIONS.at)(counts.n));
            assert_eq!(done.additions, (printed::MB_ADDITIONS.at)(counts.n) + counts.n);
            assert_eq!(done.multiplications - counts.mb.multiplications, counts.n * counts.n);
        }
    }
}
