//! The mathematics of the loop, with no clock and no I/O.
//!
//! | module | what it holds |
//! |---|---|
//! | [`scalar`] | the number type everything here is generic over |
//! | [`lanes`] | such a number with several lanes |
//! | [`matrix`] | products and factorisations with exactly the operations they need |
//! | [`lift`](mod@lift) | values whose numbers can be put into lanes |
//! | [`arm`] | kinematics, H, C, forward dynamics of an arm; Ĥ and Ĉ of eq. (3) |
//! | [`task`] | what of the tip is controlled; the tracking error |
//! | [`trajectory`] | desired motions with exact first and second derivatives |
//! | [`gains`] | the positive definite matrices K_p and K_d |
//! | [`law`] | the control laws, one file each |
//! | [`scenario`] | one experiment as data: TOML in, validated values out |
//! | [`scene`] | what displays draw of it: the arm, the desired path, the tracking error |
//!
//! Equation numbers refer to Moosavian and Papadopoulos, *Modified transpose Jacobian control of
//! robotic systems*, Automatica 43 (2007).

pub mod arm;
pub mod gains;
pub mod lanes;
pub mod law;
pub mod lift;
pub mod matrix;
pub mod scalar;
pub mod scenario;
pub mod scene;
pub mod task;
pub mod trajectory;

/// The most joints an arm may have; fixed-size samples carry this many.
pub const MAX_JOINTS: usize = 7;
/// The most task axes a sample carries.
pub const MAX_AXES: usize = 6;
/// The most numbers in a law's echo.
pub const MAX_ECHO: usize = 7;
/// The most numbers in a law's signals.
pub const MAX_SIGNALS: usize = 14;

/// Evaluates an expression with the constant `$N` bound to the number of links, 1 to 7.
///
/// `for_links!(count, N => Simulator::<N>::new(scenario))` is how a number from a scenario becomes
/// a static matrix dimension. The last arm stands for every count above six: a validated scenario
/// has at most [`MAX_JOINTS`] links.
#[macro_export]
macro_rules! for_links {
    ($count:expr, $N:ident => $body:expr) => {
        match $count {
            1 => {
                const $N: usize = 1;
                $body
            }
            2 => {
                const $N: usize = 2;
                $body
            }
            3 => {
                const $N: usize = 3;
                $body
            }
            4 => {
                const $N: usize = 4;
                $body
            }
            5 => {
                const $N: usize = 5;
                $body
            }
            6 => {
                const $N: usize = 6;
                $body
            }
            _ => {
                const $N: usize = 7;
                $body
            }
        }
    };
}
