//! How many joints an arm has, as a value and as a static dimension.

/// The most joints an arm may have; fixed-size samples carry this many.
pub const MAX_JOINTS: usize = 7;

/// How many joints an arm has: 1 to [`MAX_JOINTS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum JointCount {
    One = 1,
    Two,
    Three,
    Four,
    Five,
    Six,
    Seven,
}

impl JointCount {
    /// Every count, the smallest first.
    pub const ALL: [Self; MAX_JOINTS] =
        [Self::One, Self::Two, Self::Three, Self::Four, Self::Five, Self::Six, Self::Seven];

    /// This many joints; `None` if no arm may have so many.
    pub fn new(count: usize) -> Option<Self> {
        Self::ALL.get(count.checked_sub(1)?).copied()
    }

    /// The number.
    pub fn get(self) -> usize {
        self as usize
    }
}

/// Evaluates an expression with the constant `$N` bound to a [`JointCount`].
///
/// This is how a number from a scenario becomes a static dimension:
///
/// ```
/// use mtj_model::{for_joints, scenario::Scenario};
///
/// let scenario = Scenario::load("sampled/mtj", &[])?;
/// let size = for_joints!(scenario.arm.joints(), N => size_of::<[f64; N]>());
/// assert_eq!(size, 16);
/// # Ok::<(), mtj_model::scenario::ScenarioError>(())
/// ```
#[macro_export]
macro_rules! for_joints {
    ($joints:expr, $N:ident => $body:expr) => {
        $crate::for_joints! {
            @each $joints, $N, $body,
            One 1, Two 2, Three 3, Four 4, Five 5, Six 6, Seven 7
        }
    };
    (@each $joints:expr, $N:ident, $body:expr, $($count:ident $number:literal),*) => {
        match $joints {
            $($crate::JointCount::$count => {
                const $N: usize = $number;
                $body
            })*
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_that_no_arm_may_have_is_none() {
        for count in 1..=MAX_JOINTS {
            let joints = JointCount::new(count).unwrap();
            assert_eq!((joints.get(), for_joints!(joints, N => N)), (count, count));
        }
        assert_eq!((JointCount::new(0), JointCount::new(8)), (None, None));
    }
}
