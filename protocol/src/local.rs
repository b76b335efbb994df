//! The bus within one process: each reader has a mailbox, and each writer fills all of them.

use std::{
    any::{Any, TypeId},
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use mtj_model::scenario::Wait;

use crate::{
    bus::{Attendance, Bus, BusError, Depth, Offering, Reader, Writer},
    debug_by_name,
    mailbox::{Mailbox, MailboxReader},
    member::Member,
    sample::Sample,
};

/// A bus for the threads of one process. Clones share it.
#[derive(Clone, Default)]
pub struct LocalBus {
    session: Arc<Session>,
}

debug_by_name!(LocalBus);

#[derive(Default)]
struct Session {
    /// A [`Topic`] for each kind of sample.
    topics: Mutex<HashMap<TypeId, Box<dyn Any + Send>>>,
    offer: Mutex<Option<Vec<u8>>>,
    members: Mutex<Vec<Member>>,
}

struct Topic<S>(Arc<Mutex<Vec<Weak<Mailbox<S>>>>>);

impl LocalBus {
    fn topic<S: Sample>(&self) -> Arc<Mutex<Vec<Weak<Mailbox<S>>>>> {
        let mut topics = lock(&self.session.topics);
        let topic =
            topics.entry(TypeId::of::<S>()).or_insert_with(|| Box::new(Topic::<S>(Arc::default())));
        // The key is the type, so the cast cannot fail.
        topic.downcast_ref::<Topic<S>>().map(|topic| topic.0.clone()).unwrap_or_default()
    }
}

impl Bus for LocalBus {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        Ok(Box::new(LocalWriter(self.topic::<S>())))
    }

    fn reader<S: Sample>(&self, depth: Depth, _wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        let mailbox = Mailbox::new(depth);
        let topic = self.topic::<S>();
        let mut readers = lock(&topic);
        readers.retain(|reader| reader.strong_count() > 0);
        readers.push(Arc::downgrade(&mailbox));
        Ok(Box::new(MailboxReader::new(mailbox, ())))
    }

    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        *lock(&self.session.offer) = Some(bytes);
        Ok(Box::new(LocalOffer(self.clone())))
    }

    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        Ok(lock(&self.session.offer).clone())
    }

    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
        lock(&self.session.members).push(*member);
        Ok(Box::new(Announcement { bus: self.clone(), id: member.id }))
    }

    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        Ok(Box::new(self.clone()))
    }
}

impl Attendance for LocalBus {
    fn present(&mut self) -> Result<Vec<Member>, BusError> {
        Ok(lock(&self.session.members).clone())
    }

    fn is_present(&mut self, member: &Member) -> Result<bool, BusError> {
        Ok(lock(&self.session.members).contains(member))
    }
}

struct Announcement {
    bus: LocalBus,
    id: u64,
}

impl Drop for Announcement {
    fn drop(&mut self) {
        lock(&self.bus.session.members).retain(|member| member.id != self.id);
    }
}

struct LocalWriter<S>(Arc<Mutex<Vec<Weak<Mailbox<S>>>>>);

impl<S: Sample> Writer<S> for LocalWriter<S> {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        for reader in lock(&self.0).iter().filter_map(Weak::upgrade) {
            reader.put(*sample);
        }
        Ok(())
    }
}

struct LocalOffer(LocalBus);

impl Offering for LocalOffer {
    fn renew(&mut self, bytes: Vec<u8>) -> Result<(), BusError> {
        *lock(&self.0.session.offer) = Some(bytes);
        Ok(())
    }

    fn serve(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

impl Drop for LocalOffer {
    fn drop(&mut self) {
        *lock(&self.0.session.offer) = None;
    }
}

/// Locks, also after a panic elsewhere: nothing here can panic while it holds the lock.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
