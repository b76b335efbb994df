//! The paper, reproduced: its figures, its numbers and its Table 1, beside what it prints.
//!
//! | file | what it holds |
//! |---|---|
//! | [`runs`] | the twelve simulations of section 4 |
//! | [`figures`] | Figs. 1(b) to 5, drawn from their traces |
//! | [`counting`] | a number that counts the operations it takes part in |
//! | [`operations`] | Table 1, by running the laws on such numbers |
//! | [`table`] | what the paper prints beside what comes out here |
//! | [`comparison`] | one statement of it, and the table as text |

pub mod comparison;
pub mod counting;
pub mod figures;
pub mod operations;
pub mod runs;
pub mod table;
