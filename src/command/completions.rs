//! `mtj completions`: a script with which a shell completes commands and options.

use std::io::{self, Write};

use clap::Args;
use clap_complete::{Shell, generate};

use crate::failure::Failure;

/// Print a script with which a shell completes commands and options
#[derive(Args, Debug)]
pub struct Completions {
    /// The shell that is to complete
    shell: Shell,
}

impl Completions {
    /// Prints the script for a program to standard output.
    pub fn run(self, mut program: clap::Command) -> Result<(), Failure> {
        // Into memory first: the generator panics where its output is closed early.
        let mut script = Vec::new();
        generate(self.shell, &mut program, "mtj", &mut script);
        Ok(io::stdout().write_all(&script)?)
    }
}
