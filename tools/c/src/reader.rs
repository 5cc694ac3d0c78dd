//! A reader of one topic, whichever it is.

use crate::Error;
use randt_messages::{Topic, TopicVisitor, visit_bus_topics};
use randt_stage::{Domain, Observer, Received, Registry, Subscriber};
use std::ffi::c_void;
use std::ptr::{from_ref, null};
use std::rc::Rc;
use std::time::Duration;

/// A message where it lies in shared memory: `struct randt_message`.
#[derive(Debug)]
#[repr(C)]
pub struct Message {
    /// The topic's head.
    pub head: *const c_void,
    /// Its items.
    pub items: *const c_void,
    /// How many.
    pub item_count: usize,
}

impl Message {
    /// Nothing has come.
    pub const NONE: Self = Self {
        head: null(),
        items: null(),
        item_count: 0,
    };
}

/// Reads a topic whose types the caller does not know.
pub(crate) trait Reader {
    /// The next message, which stays where it is until the next call; `None` where none comes in
    /// this time.
    fn receive(&mut self, timeout: Duration) -> Result<Option<Message>, Error>;

    /// Messages that were missed so far.
    fn missed(&self) -> u64;
}

struct TopicReader<T: Topic> {
    // The message goes before the port, the port before the node: fields are dropped in order.
    received: Option<Received<T>>,
    subscriber: Subscriber<T>,
    observer: Rc<Observer>,
}

impl<T: Topic> Reader for TopicReader<T> {
    fn receive(&mut self, timeout: Duration) -> Result<Option<Message>, Error> {
        // The place of the last one is free before the next is taken.
        self.received = None;
        self.received = self.subscriber.receive()?;
        if self.received.is_none() && !timeout.is_zero() {
            self.observer.wait(&self.subscriber, timeout)?;
            self.received = self.subscriber.receive()?;
            if self.received.is_none() {
                self.observer.check_memory()?;
            }
        }
        Ok(self.received.as_ref().map(|received| {
            let message = received.message();
            Message {
                head: from_ref(message.head).cast(),
                items: message.items.as_ptr().cast(),
                item_count: message.items.len(),
            }
        }))
    }

    fn missed(&self) -> u64 {
        self.subscriber.missed()
    }
}

/// Finds a topic by its name.
struct Opening<'a> {
    topic: &'a str,
    type_name: &'a str,
    observer: &'a Rc<Observer>,
    reader: Option<Box<dyn Reader>>,
}

impl TopicVisitor for Opening<'_> {
    type Error = Error;

    fn visit<T: Topic>(&mut self) -> Result<(), Error> {
        if T::NAME != self.topic {
            return Ok(());
        }
        if T::TYPE_NAME != self.type_name {
            return Err(Error::Header {
                topic: T::NAME,
                ours: T::TYPE_NAME,
                theirs: self.type_name.to_owned(),
            });
        }
        self.reader = Some(Box::new(TopicReader::<T> {
            received: None,
            subscriber: self.observer.subscriber()?,
            observer: Rc::clone(self.observer),
        }));
        Ok(())
    }
}

/// Opens a topic that a stage has open: a reader never makes one.
pub(crate) fn open(
    domain: &Domain,
    observer: &Rc<Observer>,
    topic: &str,
    type_name: &str,
) -> Result<Box<dyn Reader>, Error> {
    let stages = Registry::all(domain);
    let mut living = stages.iter().filter(|(_, lives)| *lives);
    let mut opening = Opening {
        topic,
        type_name,
        observer,
        reader: None,
    };
    if living.any(|(entry, _)| entry.topics.contains_key(topic)) {
        visit_bus_topics(&mut opening)?;
    }
    let nobody = || Error::NobodyHas(topic.to_owned());
    opening.reader.ok_or_else(nobody)
}
