//! An audience that records all it hears.

use std::{
    io,
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender},
    thread::{self, JoinHandle},
    time::{Duration, Instant, SystemTime},
};

use mtj_protocol::{bus::BusError, port::Message};

use super::{
    file::RecordingFile,
    timeline::Timeline,
    topic::{Counts, TOPICS, Topic},
};
use crate::monitor::Audience;

/// The most that a kill can cost.
const FLUSH: Duration = Duration::from_secs(1);
/// How many messages wait for the disk; some seconds at 10 kHz.
const QUEUE: usize = 1 << 16;
/// How often to say that messages are lost, at most.
const COMPLAINT: Duration = Duration::from_secs(5);

/// Records a session in a file, on a thread of its own: when the disk does not keep up, messages are
/// lost, counted and reported, and nobody waits.
pub struct Recorder {
    path: PathBuf,
    queue: Option<SyncSender<(u64, Message)>>,
    thread: Option<JoinHandle<Written>>,
    timeline: Timeline,
    heard: Counts,
    safe: Counts,
    overrun: u64,
    complaint: Option<(Instant, u64)>,
    newest: Option<(u64, u64)>,
    missed: u64,
}

/// What became of a file.
struct Written {
    safe: Counts,
    outcome: io::Result<()>,
}

impl Recorder {
    /// Records in a file that was begun; `path` is its name.
    pub fn start(path: &Path, file: RecordingFile) -> io::Result<Self> {
        let (queue, messages) = mpsc::sync_channel(QUEUE);
        let thread = thread::Builder::new()
            .name("mtj-recorder".to_owned())
            .spawn(move || write_down(file, &messages))?;
        say(&format!("recording to {}", path.display()));
        Ok(Self {
            path: path.to_owned(),
            queue: Some(queue),
            thread: Some(thread),
            timeline: Timeline::default(),
            heard: Counts::default(),
            safe: Counts::default(),
            overrun: 0,
            complaint: None,
            newest: None,
            missed: 0,
        })
    }

    fn count(&mut self, message: &Message) {
        self.heard[Topic::of(message) as usize] += 1;
        if let Message::State(state) = message {
            let header = state.header;
            if let Some((run, sequence)) = self.newest
                && run == header.run
            {
                self.missed += header.sequence.saturating_sub(sequence + 1);
            }
            self.newest = Some((header.run, header.sequence));
        }
    }

    /// Says so, if messages are lost because the disk is too slow.
    fn complain(&mut self) {
        let due = |(said, lost): (Instant, u64)| lost < self.overrun && said.elapsed() > COMPLAINT;
        if self.overrun > 0 && self.complaint.is_none_or(due) {
            self.complaint = Some((Instant::now(), self.overrun));
            say(&format!(
                "{}: the disk does not keep up; {} messages are lost so far",
                self.path.display(),
                self.overrun
            ));
        }
    }

    /// Lets the thread come to its end, and says so if it was not the one that was meant.
    fn conclude(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        self.queue = None;
        let Ok(Written { safe, outcome }) = thread.join() else {
            say(&format!("{}: the recorder failed", self.path.display()));
            return;
        };
        self.safe = safe;
        if let Err(error) = outcome {
            let reason = match error.kind() {
                io::ErrorKind::StorageFull => "the disk is full".to_owned(),
                _ => error.to_string(),
            };
            say(&format!(
                "{}: {reason}; the recording ends here, what was recorded until now can be read, \
                 and monitoring goes on",
                self.path.display()
            ));
        }
    }

    fn tally(&self) -> String {
        let of_each = TOPICS.map(|topic| format!("{} {}", self.safe[topic as usize], topic.name()));
        let dropped = self.heard.iter().sum::<u64>() - self.safe.iter().sum::<u64>();
        format!(
            "recorded in {}: {}; {dropped} messages dropped, {} states missed",
            self.path.display(),
            of_each.join(", "),
            self.missed
        )
    }
}

impl Audience for Recorder {
    fn hear(&mut self, message: &Message) {
        self.count(message);
        let Some(queue) = &self.queue else { return };
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let log_time = self.timeline.place(message, now.as_nanos() as u64);
        let outcome = queue.try_send((log_time, message.clone()));
        self.overrun += u64::from(matches!(outcome, Err(mpsc::TrySendError::Full(_))));
    }

    fn refresh(&mut self) -> Result<bool, BusError> {
        self.complain();
        if self.thread.as_ref().is_some_and(JoinHandle::is_finished) {
            self.conclude();
        }
        Ok(true)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.conclude();
        say(&self.tally());
    }
}

/// On standard error, because standard output belongs to the view.
fn say(sentence: &str) {
    eprintln!("mtj monitor: {sentence}");
}

/// Writes down messages until there are no more.
fn write_down(mut file: RecordingFile, messages: &Receiver<(u64, Message)>) -> Written {
    let outcome = write_all(&mut file, messages);
    let safe = file.safe();
    if outcome.is_err() {
        // The disk is full or gone: there is nothing more to be done about it.
        let _ = file.abandon();
    }
    Written { safe, outcome }
}

fn write_all(file: &mut RecordingFile, messages: &Receiver<(u64, Message)>) -> io::Result<()> {
    let mut flush = Instant::now() + FLUSH;
    loop {
        match messages.recv_timeout(flush.saturating_duration_since(Instant::now())) {
            Ok((log_time, message)) => file.write(log_time, &message)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return file.finish(),
        }
        if Instant::now() >= flush {
            file.flush()?;
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

    #[test]
    fn what_the_disk_cannot_take_is_counted_and_nobody_waits_for_it() {
        // A pipe that nobody reads is a disk that is stuck.
        let (mut disk, pipe) = io::pipe().unwrap();
        let file = File::from(OwnedFd::from(pipe));
        let file = RecordingFile::begin(file, BTreeMap::new()).unwrap();
        let mut recorder = Recorder::start(Path::new("pipe"), file).unwrap();
        let heard = 3 * QUEUE as u64;
        for sequence in 0..heard {
            let header = Header { run: 1, sequence, ..Header::default() };
            recorder.hear(&Message::State(StateSample { header, ..Default::default() }));
        }
        assert!(recorder.refresh().unwrap());
        assert!((1..=2 * QUEUE as u64).contains(&recorder.overrun), "{}", recorder.overrun);
        assert!(recorder.complaint.is_some());

        let reading = thread::spawn(move || io::copy(&mut disk, &mut io::sink()).unwrap());
        recorder.conclude();
        let states = recorder.safe[Topic::State as usize];
        assert_eq!(states + recorder.overrun, heard);
        let tally = recorder.tally();
        assert!(tally.contains(&format!("{states} state, ")), "{tally}");
        assert!(tally.contains(&format!("; {} messages dropped", recorder.overrun)), "{tally}");
        assert!(reading.join().unwrap() > 0);
    }
}
