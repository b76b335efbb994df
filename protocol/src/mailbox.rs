//! A bounded queue between two threads that keeps the newest samples.

use std::{
    collections::VecDeque,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use crate::{
    bus::{BusError, Depth, RECENT_DEPTH, Reader, STREAM_DEPTH},
    sample::Sample,
};

/// A queue that a transport's own thread fills and a reader empties; when full, it drops the
/// oldest.
pub(crate) struct Mailbox<S> {
    inner: Mutex<Inner<S>>,
    filled: Condvar,
    capacity: usize,
}

struct Inner<S> {
    queue: VecDeque<S>,
    malformed: u64,
}

impl<S> Mailbox<S> {
    /// An empty mailbox.
    pub(crate) fn new(depth: Depth) -> Arc<Self> {
        let capacity = match depth {
            Depth::Recent => RECENT_DEPTH,
            Depth::Stream => STREAM_DEPTH,
        };
        let inner = Inner { queue: VecDeque::with_capacity(capacity), malformed: 0 };
        Arc::new(Self { inner: Mutex::new(inner), filled: Condvar::new(), capacity })
    }

    /// Appends a sample; drops the oldest if there is no room.
    pub(crate) fn put(&self, sample: S) {
        let mut inner = self.lock();
        if inner.queue.len() == self.capacity {
            inner.queue.pop_front();
        }
        inner.queue.push_back(sample);
        drop(inner);
        self.filled.notify_one();
    }

    /// Counts a message that was no sample.
    #[cfg(feature = "zenoh")]
    pub(crate) fn put_malformed(&self) {
        self.lock().malformed += 1;
    }

    /// Locks, also after a panic elsewhere, which cannot leave the queue half changed.
    fn lock(&self) -> MutexGuard<'_, Inner<S>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The reading end of a mailbox, and the subscription that fills it.
pub(crate) struct MailboxReader<S, K> {
    mailbox: Arc<Mailbox<S>>,
    /// The current one.
    sample: S,
    /// A subscription, or nothing.
    #[expect(dead_code, reason = "held for its destructor")]
    keep: K,
}

impl<S: Sample, K> MailboxReader<S, K> {
    /// The reading end of `mailbox`.
    pub(crate) fn new(mailbox: Arc<Mailbox<S>>, keep: K) -> Self {
        Self { mailbox, sample: S::default(), keep }
    }
}

impl<S: Sample, K> Reader<S> for MailboxReader<S, K> {
    fn advance(&mut self) -> Result<bool, BusError> {
        let Some(sample) = self.mailbox.lock().queue.pop_front() else { return Ok(false) };
        self.sample = sample;
        Ok(true)
    }

    fn sample(&self) -> &S {
        &self.sample
    }

    fn sleep(&mut self, until: Instant) -> Result<(), BusError> {
        let inner = self.mailbox.lock();
        let patience = until.saturating_duration_since(Instant::now());
        if inner.queue.is_empty() && !patience.is_zero() {
            let _ = self.mailbox.filled.wait_timeout(inner, patience);
        }
        Ok(())
    }

    fn spin(&mut self) -> Result<bool, BusError> {
        let found = self.advance()?;
        if !found {
            std::thread::yield_now();
        }
        Ok(found)
    }

    fn has_more(&self) -> bool {
        !self.mailbox.lock().queue.is_empty()
    }

    fn malformed(&self) -> u64 {
        self.mailbox.lock().malformed
    }
}
