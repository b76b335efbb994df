//! A slot: the newest value of one writer, on iceoryx2's blackboard.
//!
//! A blackboard's entry has one writer, and one that is killed leaves it locked for as long as anybody has the
//! service open (iceoryx2 #2008). So a slot belongs to one incarnation of a writer and is named by the number of
//! its publisher, which no other ever has; who follows another writer opens another slot.

use iceoryx2::{
    port::{
        reader::{BlackboardValue, EntryHandle},
        writer::{EntryHandleMut, EntryValueUninit},
    },
    prelude::{Node, ServiceName, ipc},
};

use super::{MAX_NODES, MAX_READERS, error::Trouble};
use crate::sample::{Header, Sample};

/// A slot has one entry.
const ENTRY: u8 = 0;

/// The writing end. Its entry is missing only while it becomes the other thing.
pub struct SlotWriter<S: Sample>(Option<Entry<S>>);

enum Entry<S: Sample> {
    AsItIs(EntryHandleMut<ipc::Service, u8, S>),
    /// Its next value was asked for, and where that lies is known.
    Prepared(EntryValueUninit<ipc::Service, u8, S>),
}

impl<S: Sample> SlotWriter<S> {
    /// Makes the slot of this name. Only inside.
    pub fn create(node: &Node<ipc::Service>, name: &ServiceName) -> Result<Self, Trouble> {
        let service = node
            .service_builder(name)
            .blackboard_creator::<u8>()
            .max_readers(MAX_READERS)
            .max_nodes(MAX_NODES)
            .add_with_default::<S>(ENTRY)
            .create()?;
        Ok(Self(Some(Entry::AsItIs(service.writer_builder().create()?.entry(&ENTRY)?))))
    }

    /// Makes a sample visible.
    pub fn write(&mut self, sample: &S) {
        self.0 = self.0.take().map(|entry| match entry {
            Entry::Prepared(value) => Entry::AsItIs(value.update_with_copy(*sample)),
            Entry::AsItIs(entry) => {
                entry.update_with_copy(*sample);
                Entry::AsItIs(entry)
            }
        });
    }

    /// Makes ready for the next sample, while nobody waits for it. An entry has room for two values, which are
    /// written in turns. Where the next one goes, only a counter says that was last in a reader's cache; and there
    /// its memory is too, since the sample before the last. Any sample written there fetches it.
    pub fn prepare(&mut self, any: &S) {
        self.0 = self.0.take().map(|entry| match entry {
            Entry::AsItIs(entry) => {
                let mut value = entry.loan_uninit();
                value.value_mut().write(*any);
                Entry::Prepared(value)
            }
            prepared => prepared,
        });
    }
}

/// The reading end.
pub struct SlotReader<S: Sample> {
    entry: EntryHandle<ipc::Service, u8, S>,
    /// What was read last.
    last: BlackboardValue<S>,
    /// Whether that is still to be taken.
    is_fresh: bool,
}

impl<S: Sample> SlotReader<S> {
    /// Opens the slot of this name, whose writer's sample `known` was had from elsewhere. Only inside.
    pub fn open(
        node: &Node<ipc::Service>,
        name: &ServiceName,
        known: &Header,
    ) -> Result<Self, Trouble> {
        let service = node.service_builder(name).blackboard_opener::<u8>().open()?;
        let entry = service.reader_builder().create()?.entry::<S>(&ENTRY)?;
        let last = entry.get();
        let is_fresh = last.header() != known;
        Ok(Self { entry, last, is_fresh })
    }

    /// Whether there is a sample that was not taken.
    pub fn has_news(&self) -> bool {
        self.is_fresh || !self.entry.is_up_to_date(&self.last)
    }

    /// Goes on to the newest sample, if that was not taken yet.
    pub fn advance(&mut self) -> bool {
        if !self.has_news() {
            return false;
        }
        self.is_fresh = false;
        loop {
            self.last = self.entry.get();
            // What was written while we read may be what we have read, and would look new once more.
            if self.entry.is_up_to_date(&self.last) {
                return true;
            }
        }
    }

    /// The sample that was gone on to last.
    pub fn sample(&self) -> &S {
        &self.last
    }
}
