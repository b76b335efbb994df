//! A sink that records all messages.

use std::{
    io,
    sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender},
    thread::{self, JoinHandle},
    time::{Duration, Instant, SystemTime},
};

use mtj_protocol::port::Message;
use tracing::{error, info, warn};

use super::{
    gaps::Gaps,
    parts::{PartWriter, PartsWritten},
    timeline::Timeline,
    topic::{Counts, Topic, counts_in_words},
};
use crate::{error::MonitorError, filter::Filter, monitor::Sink};

/// How often the file is flushed: the most that a crash can lose.
const FLUSH: Duration = Duration::from_secs(1);
/// How many messages can wait for the disk; some seconds at 10 kHz.
const QUEUE: usize = 1 << 16;
/// The shortest time between two warnings about lost messages.
const WARNING: Duration = Duration::from_secs(5);

/// Records a session in a file, or in one part after another.
///
/// A thread of its own writes. Messages that the disk is too slow for are lost, counted and
/// reported; the monitor does not wait.
#[derive(Debug)]
pub struct Recorder {
    /// The first file, for messages to the user.
    file: String,
    filter: Filter,
    queue: Option<SyncSender<(u64, Message)>>,
    thread: Option<JoinHandle<Written>>,
    timeline: Timeline,
    received: Counts,
    written: Option<PartsWritten>,
    /// How many messages did not fit into the queue.
    overrun: u64,
    /// When the last warning was logged, and `overrun` at that time.
    warned: Option<(Instant, u64)>,
    gaps: Gaps,
}

/// What the thread wrote.
#[derive(Debug)]
struct Written {
    parts: PartsWritten,
    outcome: io::Result<()>,
}

impl Recorder {
    /// Starts to record what passes `filter` with `writer`.
    pub(super) fn start(writer: PartWriter, filter: Filter) -> io::Result<Self> {
        let file = writer.path().display().to_string();
        let (queue, messages) = mpsc::sync_channel(QUEUE);
        let thread = thread::Builder::new()
            .name("mtj-recorder".to_owned())
            .spawn(move || write(writer, &messages))?;
        info!("recording to {file}");
        Ok(Self {
            file,
            filter,
            queue: Some(queue),
            thread: Some(thread),
            timeline: Timeline::default(),
            received: Counts::default(),
            written: None,
            overrun: 0,
            warned: None,
            gaps: Gaps::default(),
        })
    }

    /// Warns, not too often, when messages were lost because the disk is too slow.
    fn warn_of_overrun(&mut self) {
        let is_due = |(at, lost): (Instant, u64)| lost < self.overrun && at.elapsed() > WARNING;
        if self.overrun > 0 && self.warned.is_none_or(is_due) {
            self.warned = Some((Instant::now(), self.overrun));
            warn!(
                "{}: the disk does not keep up; {} messages are lost so far",
                self.file, self.overrun
            );
        }
    }

    /// Lets the thread finish, and reports its error.
    fn finish(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        self.queue = None;
        let Ok(Written { parts, outcome }) = thread.join() else {
            error!("{}: the recorder failed", self.file);
            return;
        };
        if let Err(error) = outcome {
            error!(
                "{}: {}; the recording ends here, what was recorded until now can be read, and \
                 monitoring goes on",
                parts.last.display(),
                reason(&error)
            );
        }
        self.written = Some(parts);
    }

    /// How many messages were recorded, dropped and missed, as a sentence.
    fn summary(&self) -> String {
        let (files, counts) = match &self.written {
            Some(parts) => (parts.files(), parts.counts),
            None => (self.file.clone(), Counts::default()),
        };
        let dropped = self.received.iter().sum::<u64>() - counts.iter().sum::<u64>();
        format!(
            "recorded in {files}: {}; {dropped} messages dropped, {} states missed",
            counts_in_words(&counts),
            self.gaps.missed()
        )
    }
}

/// Why a file could not be written.
pub(super) fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::StorageFull => "the disk is full".to_owned(),
        _ => error.to_string(),
    }
}

impl Sink for Recorder {
    fn handle(&mut self, message: &Message) {
        // Gaps and times follow all messages, so that what is left out on purpose changes neither.
        self.gaps.note(message);
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let log_time = self.timeline.log_time(message, now.as_nanos() as u64);
        if !self.filter.passes(message) {
            return;
        }
        self.received[Topic::of(message) as usize] += 1;
        let Some(queue) = &self.queue else { return };
        let outcome = queue.try_send((log_time, message.clone()));
        self.overrun += u64::from(matches!(outcome, Err(mpsc::TrySendError::Full(_))));
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        self.warn_of_overrun();
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            self.finish();
        }
        Ok(true)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.finish();
        info!("{}", self.summary());
    }
}

/// Writes messages until the queue is closed.
fn write(mut writer: PartWriter, messages: &Receiver<(u64, Message)>) -> Written {
    let outcome = write_all(&mut writer, messages);
    Written { parts: writer.end(outcome.is_err()), outcome }
}

fn write_all(writer: &mut PartWriter, messages: &Receiver<(u64, Message)>) -> io::Result<()> {
    let mut flush = Instant::now() + FLUSH;
    loop {
        match messages.recv_timeout(flush.saturating_duration_since(Instant::now())) {
            Ok((log_time, message)) => writer.write(log_time, &message)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return writer.finish(),
        }
        if Instant::now() >= flush {
            writer.flush()?;
            flush = Instant::now() + FLUSH;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

    use std::{collections::BTreeMap, fs::File, os::fd::OwnedFd};

    use mtj_protocol::sample::{Header, StateSample};

    use super::*;
    use crate::recording::writer::RecordingWriter;

    #[test]
    fn messages_that_the_disk_is_too_slow_for_are_counted_and_the_monitor_does_not_wait() {
        // A pipe without a reader behaves like a disk that hangs.
        let (mut disk, pipe) = io::pipe().unwrap();
        let file = File::from(OwnedFd::from(pipe));
        let writer = RecordingWriter::new(file, BTreeMap::new()).unwrap();
        let mut recorder =
            Recorder::start(PartWriter::single("pipe".into(), writer), Filter::default()).unwrap();
        let received = 3 * QUEUE as u64;
        for sequence in 0..received {
            let header = Header { run: 1, sequence, ..Header::default() };
            recorder.handle(&Message::State(StateSample { header, ..Default::default() }));
        }
        assert!(recorder.refresh().unwrap());
        assert!((1..=2 * QUEUE as u64).contains(&recorder.overrun), "{}", recorder.overrun);
        assert!(recorder.warned.is_some());

        let reading = thread::spawn(move || io::copy(&mut disk, &mut io::sink()).unwrap());
        recorder.finish();
        let states = recorder.written.as_ref().unwrap().counts[Topic::State as usize];
        assert_eq!(states + recorder.overrun, received);
        let summary = recorder.summary();
        assert!(summary.contains(&format!("{states} state, ")), "{summary}");
        assert!(summary.contains(&format!("; {} messages dropped", recorder.overrun)), "{summary}");
        assert!(reading.join().unwrap() > 0);
    }
}
