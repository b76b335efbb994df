//! What a test needs besides a Rust toolchain. `tests/run` installs it, and there its lack is a
//! failure; under a plain `cargo test` the test is left out, and says so.

use std::{
    env, fs,
    io::{self, Write},
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// Set by `tests/run`: nothing may be left out.
const ALL: &str = "MTJ_ALL_TESTS";

/// Something that not every machine has.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// Chromium without a screen.
    Browser,
    /// Python with the packages mcap, fastjsonschema and zenoh.
    Python,
    /// Network namespaces, for machines of one's own.
    Machines,
    /// libfaketime, for a clock that jumps.
    Clock,
}

impl Need {
    fn is_there(self) -> bool {
        match self {
            Self::Browser => runs("chromedriver", "--version"),
            Self::Python => runs(python(), "-c=import mcap, fastjsonschema, zenoh"),
            Self::Machines => is_root() && runs("ip", "-V"),
            Self::Clock => faketime().is_some(),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Browser => "chromedriver and chromium (Debian: chromium chromium-driver)",
            Self::Python => "Python's packages mcap, fastjsonschema and eclipse-zenoh (MTJ_PYTHON)",
            Self::Machines => "root and ip, for network namespaces (Debian: iproute2)",
            Self::Clock => "libfaketime (Debian: faketime)",
        }
    }

    /// Whether to go on with a test: it is there. Else says that the test is left out.
    ///
    /// # Panics
    ///
    /// If it is not there and nothing may be left out.
    pub fn is_met(self, test: &str) -> bool {
        let is_met = self.is_there();
        if !is_met {
            let sentence = format!("{test} needs {}; tests/run installs it", self.words());
            assert!(env::var_os(ALL).is_none(), "{sentence}");
            // Past the harness, which shows what is printed only of tests that fail.
            let _ = writeln!(io::stderr(), "left out: {sentence}");
        }
        is_met
    }
}

/// Returns from a test, after a line that says so, where what it needs is not there.
macro_rules! needs {
    ($($need:ident),+) => {
        let test = std::thread::current().name().unwrap_or("a test").to_owned();
        if !(true $(&& $crate::needs::Need::$need.is_met(&test))+) {
            return;
        }
    };
}
pub(crate) use needs;

/// Whether this is root.
pub fn is_root() -> bool {
    fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0)
}

fn runs(program: impl AsRef<Path>, argument: &str) -> bool {
    let arguments = argument.splitn(2, '=');
    let status = Command::new(program.as_ref())
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    status.is_ok_and(|status| status.success())
}

/// The Python of the tests.
pub fn python() -> PathBuf {
    env::var_os("MTJ_PYTHON").map_or_else(|| "python3".into(), PathBuf::from)
}

/// libfaketime, which changes what a process sees of the wall clock, and of nothing else.
pub fn faketime() -> Option<PathBuf> {
    fs::read_dir("/usr/lib").ok()?.flatten().find_map(|architecture| {
        let library = architecture.path().join("faketime/libfaketimeMT.so.1");
        library.exists().then_some(library)
    })
}
