//! Shows log lines on the dashboard, and on standard error once the dashboard is closed.
//!
//! While the dashboard is open, a line on standard error would land anywhere on its screen. The
//! layer of [`log_layer`] keeps such lines instead. The dashboard shows the newest one. When it
//! closes, all of them are logged again, and standard error gets them.
//!
//! ```no_run
//! use tracing_subscriber::{fmt, prelude::*};
//!
//! let stderr = fmt::layer().with_writer(std::io::stderr);
//! tracing_subscriber::registry().with(mtj_monitor::terminal::log_layer(stderr)).init();
//! ```
//!
//! Output that bypasses `tracing`, as of a C library, still lands on the screen; the dashboard
//! repaints all of it every three seconds. A panic first closes the dashboard, then reports itself.

use std::{
    collections::VecDeque,
    fmt::{self, Write},
    io::{IsTerminal, stderr},
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    time::{Duration, Instant},
};

use tracing::{
    Event, Level, Subscriber, debug, error,
    field::{Field, Visit},
    info, trace, warn,
};
use tracing_subscriber::{
    filter::dynamic_filter_fn,
    layer::{Context, Layer},
    registry::LookupSpan,
};

/// How many lines are kept while the dashboard is open.
const KEPT: usize = 200;

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LogLine {
    pub level: Level,
    pub text: String,
}

/// The lines of the log since the dashboard was opened.
struct Log {
    is_open: bool,
    lines: VecDeque<LogLine>,
    dropped: u64,
    newest: Option<Instant>,
}

static LOG: Mutex<Log> =
    Mutex::new(Log { is_open: false, lines: VecDeque::new(), dropped: 0, newest: None });
/// Whether standard error must be silent, because it is the terminal of an open dashboard.
static SILENT: AtomicBool = AtomicBool::new(false);

fn lock() -> MutexGuard<'static, Log> {
    LOG.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Combines a layer that writes to standard error with one that passes log lines to the terminal
/// dashboard. While the dashboard is open, `stderr` is silent if standard error is a terminal.
pub fn log_layer<S, L>(stderr: L) -> impl Layer<S>
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    L: Layer<S>,
{
    // A dynamic filter, since the answer for one call site changes.
    stderr.with_filter(dynamic_filter_fn(|_, _| !SILENT.load(Relaxed))).and_then(DashboardLayer)
}

struct DashboardLayer;

impl<S: Subscriber> Layer<S> for DashboardLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut log = lock();
        if log.is_open {
            let mut text = Text(String::new());
            event.record(&mut text);
            log.push(LogLine { level: *event.metadata().level(), text: text.0 });
        }
    }
}

/// The message of an event, followed by its other fields.
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

impl Log {
    fn push(&mut self, mut line: LogLine) {
        if self.lines.len() == KEPT {
            self.dropped += 1;
            self.lines.pop_front();
        }
        // Control characters could move the cursor or clear the screen.
        line.text.retain(|c| !c.is_control());
        self.lines.push_back(line);
        self.newest = Some(Instant::now());
    }
}

/// From now on keeps log lines for the dashboard.
pub(super) fn open() {
    lock().is_open = true;
    SILENT.store(stderr().is_terminal(), Relaxed);
}

/// Stops to keep log lines; logs those again that standard error did not get.
pub(super) fn close() {
    let (lines, dropped) = {
        let mut log = lock();
        log.is_open = false;
        (std::mem::take(&mut log.lines), std::mem::take(&mut log.dropped))
    };
    if !SILENT.swap(false, Relaxed) {
        return;
    }
    for LogLine { level, text } in lines {
        match level {
            Level::ERROR => error!("{text}"),
            Level::WARN => warn!("{text}"),
            Level::INFO => info!("{text}"),
            Level::DEBUG => debug!("{text}"),
            Level::TRACE => trace!("{text}"),
        }
    }
    if dropped > 0 {
        warn!("{dropped} earlier lines were not kept");
    }
}

/// The newest line, unless it is older than `age`.
pub(super) fn newest(age: Duration) -> Option<LogLine> {
    let log = lock();
    log.newest.filter(|newest| newest.elapsed() < age)?;
    log.lines.back().cloned()
}

#[cfg(test)]
mod tests {
    use std::{io, sync::Arc};

    use tracing_subscriber::{fmt, prelude::*};

    use super::*;

    #[derive(Clone, Default)]
    struct Output(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Output {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Output {
        fn take(&self) -> String {
            String::from_utf8(std::mem::take(&mut *self.0.lock().unwrap())).unwrap()
        }
    }

    #[test]
    fn standard_error_gets_the_lines_of_an_open_dashboard_when_it_closes() {
        let output = Output::default();
        let writer = output.clone();
        let stderr = fmt::layer()
            .with_ansi(false)
            .without_time()
            .with_target(false)
            .with_writer(move || writer.clone());
        let subscriber = tracing_subscriber::registry().with(log_layer(stderr));
        let log = |number: usize| warn!("\x1b[2Jline {number}\r");
        tracing::subscriber::with_default(subscriber, || {
            log(0);
            assert_eq!(output.take().lines().count(), 1, "no dashboard is open");

            lock().is_open = true;
            SILENT.store(true, Relaxed);
            assert_eq!(newest(Duration::from_secs(60)), None);
            for number in 1..=KEPT + 1 {
                log(number);
            }
            info!(count = 3, "late commands");
            assert_eq!(output.take(), "");
            let expected = LogLine { level: Level::INFO, text: "late commands count=3".to_owned() };
            assert_eq!(newest(Duration::from_secs(60)), Some(expected));
            assert_eq!(newest(Duration::ZERO), None, "an old line is not shown");

            close();
            let lines = output.take();
            let lines: Vec<_> = lines.lines().map(str::trim).collect();
            assert_eq!(lines.len(), KEPT + 1);
            assert_eq!(lines[0], "WARN [2Jline 3", "without control characters");
            assert_eq!(lines[KEPT - 1], "INFO late commands count=3");
            assert_eq!(lines[KEPT], "WARN 2 earlier lines were not kept");
            log(0);
            assert_eq!(output.take().lines().count(), 1, "the dashboard is closed");
        });
    }
}
