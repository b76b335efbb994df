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
//! | [`transition`] | from one of them to another while a loop runs |
//! | [`JointCount`] | how many joints an arm has, as a value and as a static dimension |
//! | [`gains`] | the positive definite matrices K_p and K_d |
//! | [`law`] | the control laws, one file each |
//! | [`scenario`] | one experiment as data: TOML in, validated values out; the reference of all keys |
//! | [`scene`] | what displays draw of it: the arm, the desired path, the tracking error |
//!
//! Equation numbers refer to Moosavian and Papadopoulos, *Modified transpose Jacobian control of
//! robotic systems*, Automatica 43 (2007).

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub mod arm;
pub mod gains;
mod joints;
pub mod lanes;
pub mod law;
pub mod lift;
pub mod matrix;
pub mod scalar;
pub mod scenario;
pub mod scene;
pub mod spline;
pub mod table;
pub mod task;
pub mod trajectory;
pub mod transition;

pub use joints::{JointCount, MAX_JOINTS};

/// The most task axes a sample carries.
pub const MAX_AXES: usize = 6;
/// The most numbers in a law's echo.
pub const MAX_ECHO: usize = 7;
/// The most numbers that a law keeps from sample to sample.
pub const MAX_STATE: usize = 16;
/// The most numbers in a law's signals.
pub const MAX_SIGNALS: usize = 14;
