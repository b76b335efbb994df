//! The trace of a run: every sampling instant, for plots and for comparing runs bit by bit.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
        mpsc::{self, Receiver, SyncSender, TryRecvError, TrySendError},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use mtj_model::{law::Signal, scenario::Scenario, task::Axis};
use mtj_protocol::{
    realtime,
    sample::{Axes, Echo, Joints},
};

/// The true state at one sampling instant. Nothing in it depends on wall time, unless the run does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceRow {
    /// s.
    pub time: f64,
    /// True joint angles, rad.
    pub position: Joints,
    /// True joint velocities, rad/s.
    pub velocity: Joints,
    /// True tip, m.
    pub tip: Axes,
    /// Where it should be, m.
    pub desired: Axes,
    /// desired ⊖ true, m.
    pub error: Axes,
    /// Torque in effect when the sample was taken, N m.
    pub torque: Joints,
    /// The law's echo in effect when the sample was taken.
    pub echo: Echo,
}

/// How many rows may wait to be written.
const WAITING: usize = 1 << 14;
/// How often waiting rows are written: the loop wakes nobody.
const PERIOD: Duration = Duration::from_millis(5);

/// Where a run sends its rows while it goes on, so that a run that is killed leaves what it did.
#[derive(Clone, Debug)]
pub struct TraceStream {
    rows: SyncSender<TraceRow>,
    dropped: Arc<AtomicU64>,
}

/// A thread that writes the rows of a [`TraceStream`] to a file.
#[derive(Debug)]
pub struct TraceWriter {
    thread: JoinHandle<io::Result<()>>,
    dropped: Arc<AtomicU64>,
}

impl TraceStream {
    /// Starts to write the trace of a scenario to a file, which is emptied when the first row comes.
    pub fn begin(scenario: &Scenario, file: File) -> io::Result<(Self, TraceWriter)> {
        let (rows, arriving) = mpsc::sync_channel(WAITING);
        let dropped = Arc::new(AtomicU64::new(0));
        let columns = Columns::of(scenario);
        let write = move || write_arriving(&arriving, &columns, file);
        let thread = thread::Builder::new().name("trace".to_owned()).spawn(write)?;
        Ok((Self { rows, dropped: Arc::clone(&dropped) }, TraceWriter { thread, dropped }))
    }

    /// Sends a row. Where there is no room, waits for it if time stands still meanwhile, and drops
    /// and counts the row otherwise.
    pub(crate) fn push(&self, row: TraceRow, may_wait: bool) {
        match self.rows.try_send(row) {
            Ok(()) => {}
            // If the thread has ended, it says why in the end.
            Err(TrySendError::Full(row)) if may_wait => drop(self.rows.send(row)),
            Err(TrySendError::Full(_)) => {
                self.dropped.fetch_add(1, Relaxed);
            }
            Err(TrySendError::Disconnected(_)) => {}
        }
    }
}

impl TraceWriter {
    /// Waits until all rows are written, when no stream is left; returns how many were dropped.
    ///
    /// # Errors
    ///
    /// What the file said.
    pub fn finish(self) -> io::Result<u64> {
        let written = self.thread.join();
        written.unwrap_or_else(|_| Err(io::Error::other("the trace was not written")))?;
        Ok(self.dropped.load(Relaxed))
    }
}

fn write_arriving(arriving: &Receiver<TraceRow>, columns: &Columns, file: File) -> io::Result<()> {
    realtime::leave_the_loop();
    let mut first = Some(file);
    let mut out = None;
    loop {
        let row = match arriving.try_recv() {
            Ok(row) => row,
            Err(TryRecvError::Disconnected) => break,
            Err(TryRecvError::Empty) => {
                if let Some(out) = &mut out {
                    BufWriter::flush(out)?;
                }
                thread::sleep(PERIOD);
                continue;
            }
        };
        if let Some(file) = first.take() {
            file.set_len(0).or_else(ignore_what_has_no_length)?;
            let mut begun = BufWriter::new(file);
            columns.write_titles(&mut begun)?;
            out = Some(begun);
        }
        if let Some(out) = &mut out {
            columns.write_row(out, &row)?;
        }
    }
    out.map_or(Ok(()), |mut out| out.flush())
}

/// A device or a pipe cannot be emptied.
fn ignore_what_has_no_length(error: io::Error) -> io::Result<()> {
    if error.kind() == io::ErrorKind::InvalidInput { Ok(()) } else { Err(error) }
}

/// Writes rows as CSV with a header line; numbers are printed so that they read back exactly.
pub fn write_csv(out: &mut impl Write, scenario: &Scenario, rows: &[TraceRow]) -> io::Result<()> {
    let columns = Columns::of(scenario);
    columns.write_titles(out)?;
    rows.iter().try_for_each(|row| columns.write_row(out, row))
}

/// The columns of a trace.
struct Columns {
    joints: usize,
    axes: &'static [Axis],
    echo: &'static Signal,
    echoed: usize,
}

impl Columns {
    fn of(scenario: &Scenario) -> Self {
        let (joints, axes) = (scenario.arm.links.len(), scenario.task.axes);
        let echo = &scenario.law.law.description().echo;
        Self { joints, axes, echo, echoed: echo.per.count(joints, axes.len()) }
    }

    fn write_titles(&self, out: &mut impl Write) -> io::Result<()> {
        let Self { joints, axes, echo, echoed } = *self;
        write!(out, "time_s")?;
        numbered(out, "q", "rad", joints)?;
        numbered(out, "q_dot", "rad/s", joints)?;
        for (before, after) in [("", ""), ("", "_desired"), ("error_", "")] {
            for Axis { name, unit } in axes {
                write!(out, ",{before}{name}{after}_{}", in_a_name(unit))?;
            }
        }
        numbered(out, "torque", "N m", joints)?;
        numbered(out, echo.key, echo.unit, echoed)?;
        writeln!(out)
    }

    fn write_row(&self, out: &mut impl Write, row: &TraceRow) -> io::Result<()> {
        let Self { joints, axes, echoed, .. } = *self;
        write!(out, "{}", row.time)?;
        let lists: [&[f64]; 7] = [
            &row.position[..joints],
            &row.velocity[..joints],
            &row.tip[..axes.len()],
            &row.desired[..axes.len()],
            &row.error[..axes.len()],
            &row.torque[..joints],
            &row.echo[..echoed],
        ];
        for number in lists.into_iter().flatten() {
            write!(out, ",{number}")?;
        }
        writeln!(out)
    }
}

/// The titles of so many columns.
fn numbered(out: &mut impl Write, name: &str, unit: &str, count: usize) -> io::Result<()> {
    (1..=count).try_for_each(|i| write!(out, ",{name}_{}_{i}", in_a_name(unit)))
}

/// A unit as names of columns have it: `nm` for N m, `rad_s` for rad/s.
fn in_a_name(unit: &str) -> String {
    unit.to_lowercase().replace(' ', "").replace('/', "_")
}
