//! The participant of DDS: what is opened in it.

use crate::bell::Rope;
use crate::bytes::{AsBytes, without_header};
use rustdds::bytes::Bytes;
use rustdds::dds::result::CreateError;
use rustdds::no_key::{DataWriter, SimpleDataReader};
use rustdds::policy::{Durability, History};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, Publisher, QosPolicies,
    QosPolicyBuilder, RTPSEntity, SampleIdentity, StatusEvented, Subscriber, Timestamp, Topic,
    TopicKind, WriteOptionsBuilder,
};
use std::net::IpAddr;

/// Quality of service as ROS's nodes ask for it, or offer it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quality {
    /// Whether what is lost is sent again.
    pub is_reliable: bool,
    /// Whether who comes late gets the last messages: transient local.
    pub is_kept: bool,
    /// Messages that are kept.
    pub depth: i32,
}

/// A participant.
pub struct Participant {
    dds: DomainParticipant,
    publisher: Publisher,
    subscriber: Subscriber,
}

/// Messages of a topic, that ring when they come.
pub struct Reader {
    dds: SimpleDataReader<Vec<u8>, AsBytes>,
    rope: Rope,
}

/// A topic's messages to others.
pub struct Writer(DataWriter<Bytes, AsBytes>);

/// One that has come.
pub struct Sample {
    /// As CDR, behind its header.
    pub message: Vec<u8>,
    /// Names it, so that an answer finds its question.
    pub identity: SampleIdentity,
    /// Whose answer it is, or who shall get the answer.
    pub related: Option<SampleIdentity>,
}

/// A writer of another participant.
pub struct Offer {
    /// As DDS names it.
    pub topic: String,
    pub type_name: String,
    pub is_reliable: bool,
    pub is_kept: bool,
}

impl Quality {
    fn policies(self) -> QosPolicies {
        let builder = QosPolicyBuilder::new()
            .history(History::KeepLast { depth: self.depth })
            .durability(match self.is_kept {
                true => Durability::TransientLocal,
                false => Durability::Volatile,
            });
        match self.is_reliable {
            // A reader that stands holds nothing up.
            true => builder.reliable(Duration::ZERO).build(),
            false => builder.best_effort().build(),
        }
    }
}

impl Participant {
    /// Joins a domain, in some networks or in all.
    pub fn join(domain: u16, networks: Option<&[IpAddr]>) -> Result<Self, CreateError> {
        let mut builder = DomainParticipantBuilder::new(domain);
        if let Some(networks) = networks {
            builder = builder.with_only_networks(networks.iter().copied());
        }
        let dds = builder.build()?;
        let none = QosPolicies::default();
        Ok(Self {
            publisher: dds.create_publisher(&none)?,
            subscriber: dds.create_subscriber(&none)?,
            dds,
        })
    }

    /// Its name in DDS.
    pub fn gid(&self) -> [u8; 16] {
        self.dds.guid().to_bytes()
    }

    /// Opens a topic for reading. What comes pulls the rope.
    pub fn reader(&self, topic: &Described<'_>, rope: Rope) -> Result<Reader, CreateError> {
        let policies = topic.quality.policies();
        let topic = self.topic(topic, &policies)?;
        let dds = self
            .subscriber
            .create_simple_datareader_no_key(&topic, None)?;
        Ok(Reader { dds, rope })
    }

    /// Opens a topic for writing.
    pub fn writer(&self, topic: &Described<'_>) -> Result<Writer, CreateError> {
        let policies = topic.quality.policies();
        let topic = self.topic(topic, &policies)?;
        let writer = self.publisher.create_datawriter_no_key(&topic, None)?;
        Ok(Writer(writer))
    }

    fn topic(&self, topic: &Described<'_>, policies: &QosPolicies) -> Result<Topic, CreateError> {
        let (name, type_name) = (topic.name.to_owned(), topic.type_name.to_owned());
        let kind = TopicKind::NoKey;
        self.dds.create_topic(name, type_name, policies, kind)
    }

    /// Whether others may have come, gone, or changed since the last call.
    pub fn has_news(&self) -> bool {
        let events = self.dds.status_listener();
        let mut has_news = false;
        while events.try_recv_status().is_some() {
            has_news = true;
        }
        has_news
    }

    /// What other participants publish.
    pub fn offers(&self) -> Vec<Offer> {
        let own = self.dds.guid().prefix;
        let writers = self.dds.discovered_writers().into_iter();
        let others = writers.map(|writer| writer.publication_topic_data);
        let others = others.filter(|writer| writer.key.prefix != own);
        let offer = |writer: rustdds::discovery::PublicationBuiltinTopicData| Offer {
            is_reliable: writer.qos().is_reliable(),
            is_kept: writer
                .durability
                .is_some_and(|it| it > Durability::Volatile),
            topic: writer.topic_name,
            type_name: writer.type_name,
        };
        others.map(offer).collect()
    }
}

/// A topic as DDS has it.
pub struct Described<'a> {
    pub name: &'a str,
    pub type_name: &'a str,
    pub quality: Quality,
}

impl Reader {
    /// All that has come, for each message what it is, or why it is no CDR.
    pub fn take(&self, mut each: impl FnMut(Result<Sample, String>)) {
        if !self.rope.was_pulled() {
            return;
        }
        // First, so that what comes meanwhile pulls it again.
        self.dds.set_waker(Some(self.rope.waker()));
        self.dds.drain_read_notifications();
        loop {
            match self.dds.try_take_one() {
                Ok(None) => return,
                Ok(Some(taken)) => each(Ok(Sample {
                    identity: SampleIdentity {
                        writer_guid: taken.writer_guid(),
                        sequence_number: taken.sequence_number,
                    },
                    related: taken.related_sample_identity(),
                    message: taken.into_value(),
                })),
                Err(error) => each(Err(error.to_string())),
            }
        }
    }

    /// Its name in DDS.
    pub fn gid(&self) -> [u8; 16] {
        self.dds.guid().to_bytes()
    }
}

impl Writer {
    /// Publishes a message; gives whether it was taken.
    pub fn write(&self, message: Vec<u8>, related: Option<SampleIdentity>) -> bool {
        let options = WriteOptionsBuilder::new()
            .source_timestamp(Timestamp::now())
            .related_sample_identity_opt(related);
        let message = without_header(message);
        self.0.write_with_options(message, options.build()).is_ok()
    }

    /// Its name in DDS.
    pub fn gid(&self) -> [u8; 16] {
        self.0.guid().to_bytes()
    }
}
