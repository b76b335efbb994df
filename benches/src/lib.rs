//! What the arithmetic costs.
//!
//! | module | what it holds |
//! |---|---|
//! | [`case`] | what is measured: a law, of how many links, in which setting |
//! | [`law`] | the laws |
//! | [`meter`] | by what a step of one is measured |
//! | [`answer`] | the whole answer to a state, what a control loop pays |
//! | [`step`] | a law alone, as the paper counts it |
//! | [`callgrind`] | counts the instructions of every case in one run of valgrind |
//! | [`table`] | the figures, and what they are of tj's |
//!
//! `time.rs` measures the same cases with criterion; `benches/run` does all of it.

pub mod answer;
pub mod callgrind;
pub mod case;
pub mod law;
pub mod meter;
pub mod step;
pub mod table;
