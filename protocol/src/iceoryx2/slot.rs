//! A slot: the newest sample of one writer, on iceoryx2's blackboard.
//!
//! A blackboard's entry has one writer. If the writer is killed, the entry stays locked for as long
//! as any process has the service open (iceoryx2 #2008). So a slot belongs to one incarnation of a
//! writer and is named by the unique number of its publisher; a reader that follows another writer
//! opens another slot.

use iceoryx2::{
    port::{
        reader::{BlackboardValue, EntryHandle},
        writer::{EntryHandleMut, EntryValueUninit},
    },
    prelude::{Node, ServiceName, ipc},
};

use super::{MAX_NODES, MAX_READERS, error::ServiceError};
use crate::sample::{Header, Sample};

/// The key of the slot's only entry.
const ENTRY: u8 = 0;

/// The writing end. It is `None` only while the entry changes its form.
pub(super) struct SlotWriter<S: Sample>(Option<Entry<S>>);

enum Entry<S: Sample> {
    Idle(EntryHandleMut<ipc::Service, u8, S>),
    /// The place of its next value is loaned, and in our cache.
    Prefetched(EntryValueUninit<ipc::Service, u8, S>),
}

impl<S: Sample> SlotWriter<S> {
    /// Creates the slot of this name; requires the domain's lock.
    pub(super) fn create(
        node: &Node<ipc::Service>,
        name: &ServiceName,
    ) -> Result<Self, ServiceError> {
        let service = node
            .service_builder(name)
            .blackboard_creator::<u8>()
            .max_readers(MAX_READERS)
            .max_nodes(MAX_NODES)
            .add_with_default::<S>(ENTRY)
            .create()?;
        Ok(Self(Some(Entry::Idle(service.writer_builder().create()?.entry(&ENTRY)?))))
    }

    /// Makes a sample visible.
    pub(super) fn write(&mut self, sample: &S) {
        self.0 = self.0.take().map(|entry| match entry {
            Entry::Prefetched(value) => Entry::Idle(value.update_with_copy(*sample)),
            Entry::Idle(entry) => {
                entry.update_with_copy(*sample);
                Entry::Idle(entry)
            }
        });
    }

    /// Prefetches the place of the next sample, off the critical path.
    ///
    /// An entry has room for two values, written in turns. The counter that tells which comes next
    /// was last in a reader's cache, and so was the memory of that value. Writing any sample there
    /// fetches both.
    pub(super) fn prefetch(&mut self, any: &S) {
        self.0 = self.0.take().map(|entry| match entry {
            Entry::Idle(entry) => {
                let mut value = entry.loan_uninit();
                value.value_mut().write(*any);
                Entry::Prefetched(value)
            }
            prefetched @ Entry::Prefetched(_) => prefetched,
        });
    }
}

/// The reading end.
pub(super) struct SlotReader<S: Sample> {
    entry: EntryHandle<ipc::Service, u8, S>,
    /// The value that was read last.
    last: BlackboardValue<S>,
    /// Whether `advance` has not returned it yet.
    is_fresh: bool,
}

impl<S: Sample> SlotReader<S> {
    /// Opens the slot of this name; requires the domain's lock. The sample of `known` was received
    /// already.
    pub(super) fn open(
        node: &Node<ipc::Service>,
        name: &ServiceName,
        known: &Header,
    ) -> Result<Self, ServiceError> {
        let service = node.service_builder(name).blackboard_opener::<u8>().open()?;
        let entry = service.reader_builder().create()?.entry::<S>(&ENTRY)?;
        let last = entry.get();
        let is_fresh = last.header() != known;
        Ok(Self { entry, last, is_fresh })
    }

    /// Whether there is a new sample.
    pub(super) fn has_news(&self) -> bool {
        self.is_fresh || !self.entry.is_up_to_date(&self.last)
    }

    /// Advances to the newest sample; returns whether it is a new one.
    pub(super) fn advance(&mut self) -> bool {
        if !self.has_news() {
            return false;
        }
        self.is_fresh = false;
        loop {
            self.last = self.entry.get();
            // A sample that was written while we read may be the one we have read; it would look
            // new once more.
            if self.entry.is_up_to_date(&self.last) {
                return true;
            }
        }
    }

    /// The current sample.
    pub(super) fn sample(&self) -> &S {
        &self.last
    }
}
