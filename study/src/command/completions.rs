//! `mtj completions`: a script with which a shell completes commands and options.

use std::io;

use clap::Args;
use clap_complete::{Shell, generate};

/// Print a script with which a shell completes commands and options
#[derive(Args, Debug)]
pub struct Completions {
    /// The shell that is to complete
    shell: Shell,
}

impl Completions {
    /// Prints the script for a program to standard output.
    pub fn run(self, mut program: clap::Command) {
        generate(self.shell, &mut program, "mtj", &mut io::stdout());
    }
}
