//! A sink that keeps the last seconds and saves them when something happens.

use std::{
    io,
    mem::{self, Discriminant},
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver, Sender},
    thread::{self, JoinHandle},
    time::{Duration, Instant, SystemTime},
};

use mtj_protocol::port::Message;
use tokio::sync::oneshot;
use tracing::{error, info, warn};

use super::{
    gaps::Gaps,
    numbered::NumberedFiles,
    parts::{self, Metadata},
    recorder::reason,
    ring::{Ring, Snapshot},
    save::{self, SaveError, SaveHandle, SaveRequest},
    timeline::Timeline,
    topic::{Counts, counts_in_words},
    writer::RecordingWriter,
};
use crate::{
    error::MonitorError,
    filter::Filter,
    monitor::Sink,
    overview::{Alarm, Overview},
};

/// How much memory the messages may take, bytes.
const MEMORY: usize = 256 << 20;
/// The shortest time between two warnings about too little memory.
const WARNING: Duration = Duration::from_secs(5);

/// Keeps the messages of the last seconds in memory, and saves them in a numbered file when an alarm
/// begins, or on request.
///
/// A thread of its own writes. While it does, further requests wait. An alarm that begins within
/// the time that is kept since the last one is saved when that time is over, so that files of
/// alarms do not overlap and a flickering link cannot fill the disk with copies.
#[derive(Debug)]
pub struct RingRecorder {
    time: Duration,
    filter: Filter,
    ring: Ring,
    timeline: Timeline,
    gaps: Gaps,
    overview: Overview,
    /// The alarm that goes on.
    alarm: Option<Discriminant<Alarm>>,
    /// The alarm that is not saved yet.
    unsaved_alarm: Option<String>,
    /// When an alarm was saved last.
    alarm_saved: Option<Instant>,
    requests: Receiver<SaveRequest>,
    waiting: Vec<SaveRequest>,
    /// The requests for the file that is being written.
    served: Option<Vec<SaveRequest>>,
    saver: Option<Saver>,
    saved: u64,
    /// When the last warning was logged, and how many messages had gone early then.
    warned: Option<(Instant, u64)>,
    /// SIGUSR1 is heard until this is dropped.
    _signal: Option<oneshot::Sender<()>>,
}

/// The thread that writes.
#[derive(Debug)]
struct Saver {
    jobs: Sender<Snapshot>,
    results: Receiver<Saved>,
    thread: JoinHandle<()>,
}

/// What became of one file.
#[derive(Debug)]
struct Saved {
    path: PathBuf,
    counts: Counts,
    time: Duration,
    outcome: io::Result<()>,
}

impl RingRecorder {
    /// Keeps the messages of this time that pass `filter`, and saves them at each request.
    pub(super) fn start(
        path: &Path,
        files: NumberedFiles,
        metadata: Metadata,
        time: Duration,
        (handle, requests): (SaveHandle, Receiver<SaveRequest>),
        filter: Filter,
    ) -> io::Result<Self> {
        let saver = Saver::start(path.to_owned(), files, metadata)?;
        let signal = save::on_signal(handle)?;
        info!("keeping the last {time:?} for {}", path.display());
        Ok(Self {
            time,
            filter,
            ring: Ring::new(time, MEMORY),
            timeline: Timeline::default(),
            gaps: Gaps::default(),
            overview: Overview::default(),
            alarm: None,
            unsaved_alarm: None,
            alarm_saved: None,
            requests,
            waiting: Vec::new(),
            served: None,
            saver: Some(saver),
            saved: 0,
            warned: None,
            _signal: Some(signal),
        })
    }

    /// Notes an alarm that begins. Waiting for a role that has not come yet is none.
    fn watch(&mut self) {
        let alarm = self.overview.alarm().filter(|alarm| !alarm.is_about_waiting());
        let kind = alarm.as_ref().map(mem::discriminant);
        if let Some(alarm) = alarm
            && kind != self.alarm
        {
            self.unsaved_alarm.get_or_insert(alarm.sentence());
        }
        self.alarm = kind;
    }

    /// Why to save now, if there is a reason.
    fn cause(&self) -> Option<String> {
        if let Some(request) = self.waiting.first() {
            return Some(request.origin.to_owned());
        }
        let is_due = self.alarm_saved.is_none_or(|at| at.elapsed() >= self.time);
        self.unsaved_alarm.clone().filter(|_| is_due)
    }

    fn save(&mut self, cause: &str) {
        let requests = mem::take(&mut self.waiting);
        let Some(snapshot) = self.ring.snapshot() else {
            warn!("{cause}: {}", SaveError::Nothing);
            for request in requests {
                (request.reply)(Err(SaveError::Nothing));
            }
            return;
        };
        if self.unsaved_alarm.take().is_some() {
            self.alarm_saved = Some(Instant::now());
        }
        info!("{cause}: saving the last {:.1} s", snapshot.time.as_secs_f64());
        self.served = Some(requests);
        if let Some(saver) = &self.saver {
            // The thread ends only if it has panicked, which shows when its result does not come.
            let _ = saver.jobs.send(snapshot);
        }
    }

    fn report(&mut self, saved: &Saved) {
        let Saved { path, counts, time, outcome } = saved;
        let file = path.display().to_string();
        if let Err(error) = outcome {
            error!(
                "{file}: {}; this file ends here, what is in it can be read, and monitoring goes on",
                reason(error)
            );
        } else {
            self.saved += 1;
            info!(
                "saved {:.1} s in {file}: {}; {} states missed so far",
                time.as_secs_f64(),
                counts_in_words(counts),
                self.gaps.missed()
            );
        }
        for request in self.served.take().into_iter().flatten() {
            (request.reply)(match outcome {
                Ok(()) => Ok(file.clone()),
                Err(error) => {
                    let reason = reason(error);
                    Err(SaveError::Write { file: file.clone(), reason })
                }
            });
        }
    }

    /// Warns, not too often, when the memory is too small for the time that was asked for.
    fn warn_of_crowding(&mut self) {
        let gone = self.ring.crowded_out();
        let is_due = |(at, before): (Instant, u64)| before < gone && at.elapsed() > WARNING;
        if gone > 0 && self.warned.is_none_or(is_due) {
            self.warned = Some((Instant::now(), gone));
            warn!(
                "--record-last {:?}: so many messages do not fit into {} MiB; a shorter time is kept",
                self.time,
                MEMORY >> 20
            );
        }
    }

    /// Saves what is still to be saved, and waits for it.
    fn finish(&mut self) {
        self.waiting.extend(self.requests.try_iter());
        self.await_saver();
        let last = self.waiting.first().map(|request| request.origin.to_owned());
        if let Some(cause) = last.or_else(|| self.unsaved_alarm.clone()) {
            self.save(&cause);
            self.await_saver();
        }
        if let Some(Saver { jobs, thread, .. }) = self.saver.take() {
            drop(jobs);
            let _ = thread.join();
        }
        info!("files saved: {}; {} states missed", self.saved, self.gaps.missed());
    }

    /// Waits for the file that is being written, if one is.
    fn await_saver(&mut self) {
        let Some(saver) = self.saver.as_ref().filter(|_| self.served.is_some()) else { return };
        match saver.results.recv() {
            Ok(saved) => self.report(&saved),
            Err(mpsc::RecvError) => self.note_failed_saver(),
        }
    }

    fn note_failed_saver(&mut self) {
        error!("the recorder failed; nothing more is saved");
        self.saver = None;
        for request in self.served.take().into_iter().flatten() {
            (request.reply)(Err(SaveError::Stopping));
        }
    }
}

impl Sink for RingRecorder {
    fn handle(&mut self, message: &Message) {
        self.overview.handle(message);
        self.gaps.note(message);
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let log_time = self.timeline.log_time(message, now.as_nanos() as u64);
        if self.filter.passes(message) {
            self.ring.push(Instant::now(), log_time, message.clone());
        }
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        self.warn_of_crowding();
        self.watch();
        self.waiting.extend(self.requests.try_iter());
        let Some(saver) = &self.saver else {
            for request in self.waiting.drain(..) {
                (request.reply)(Err(SaveError::Stopping));
            }
            return Ok(true);
        };
        if self.served.is_some() {
            match saver.results.try_recv() {
                Ok(saved) => self.report(&saved),
                Err(mpsc::TryRecvError::Empty) => return Ok(true),
                Err(mpsc::TryRecvError::Disconnected) => self.note_failed_saver(),
            }
        } else if let Some(cause) = self.cause() {
            self.save(&cause);
        }
        Ok(true)
    }
}

impl Drop for RingRecorder {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Saver {
    fn start(path: PathBuf, mut files: NumberedFiles, metadata: Metadata) -> io::Result<Self> {
        let (jobs, snapshots) = mpsc::channel();
        let (sender, results) = mpsc::channel();
        let thread = thread::Builder::new().name("mtj-recorder".to_owned()).spawn(move || {
            for snapshot in snapshots {
                let saved = write(&path, &mut files, &metadata, &snapshot);
                if sender.send(saved).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { jobs, results, thread })
    }
}

/// Writes a snapshot to the next file.
fn write(
    path: &Path,
    files: &mut NumberedFiles,
    metadata: &Metadata,
    snapshot: &Snapshot,
) -> Saved {
    let time = snapshot.time;
    let (path, mut writer) = match parts::create(files, metadata) {
        Ok(created) => created,
        Err(error) => {
            let (path, counts) = (path.to_owned(), Counts::default());
            return Saved { path, counts, time, outcome: Err(error) };
        }
    };
    let outcome = write_all(&mut writer, snapshot);
    let counts = writer.flushed();
    if outcome.is_err() {
        // The disk is full or gone: a second error tells nothing new.
        let _ = writer.abandon();
    }
    Saved { path, counts, time, outcome }
}

fn write_all(writer: &mut RecordingWriter, snapshot: &Snapshot) -> io::Result<()> {
    let mut messages = snapshot.blocks.iter().flat_map(|block| block.iter()).peekable();
    if let (Some(scenario), Some((log_time, _))) = (&snapshot.scenario, messages.peek()) {
        writer.repeat(*log_time, scenario)?;
    }
    for (log_time, message) in messages {
        writer.write(*log_time, message)?;
    }
    writer.finish()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

    use mtj_protocol::sample::StateSample;

    use super::*;

    #[test]
    fn thirty_seconds_at_4_khz_fit_into_the_memory() {
        let mut ring = Ring::new(Duration::from_secs(3600), MEMORY);
        let state = Message::State(StateSample::default());
        // A state, a torque and an error at each instant; all messages take the same memory.
        for i in 0..30 * 4000 * 3 {
            ring.push(Instant::now(), i, state.clone());
        }
        assert_eq!(ring.crowded_out(), 0);
    }
}
