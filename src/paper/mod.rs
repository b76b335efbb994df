//! The paper, reproduced: its figures, its numbers and its Table 1, beside what it prints.
//!
//! | file | what it holds |
//! |---|---|
//! | [`runs`] | the twelve simulations of section 4 |
//! | [`figures`] | Figs. 1(b) to 5, drawn from their traces |
//! | [`counting`] | a number that counts the operations it takes part in |
//! | [`operations`] | Table 1, by running the laws on such numbers |
//! | [`table`] | the paper's numbers beside ours |
//! | [`comparison`] | one statement of it, and the table as text |

pub(crate) mod comparison;
pub(crate) mod counting;
pub(crate) mod figures;
pub(crate) mod operations;
pub(crate) mod runs;
pub(crate) mod table;
