//! A service of ROS 2 of type `std_srvs/Trigger`, for clients of Fast DDS and of Cyclone DDS.

use crate::bell::Bell;
use crate::names;
use crate::participant::{Described, Participant, Quality, Reader, Sample, Writer};
use randt_ros_messages::trigger_response;
use rustdds::dds::result::CreateError;
use rustdds::{GUID, SampleIdentity};

/// Bytes of CDR's own header.
const HEADER_BYTES: usize = 4;
/// What Cyclone's clients put before each request, and look for before the reply: their name and
/// the request's number. A request itself has one byte.
const CYCLONE_BYTES: usize = 16;
/// ROS's own for services.
const QUALITY: Quality = Quality {
    is_reliable: true,
    is_kept: false,
    depth: 10,
};

/// A service.
pub struct Service {
    pub requests: Reader,
    pub replies: Writer,
}

/// Who waits for a reply.
pub struct Request {
    identity: SampleIdentity,
    before: Vec<u8>,
}

impl Service {
    /// Opens one by the name that ROS has for it.
    pub fn open(participant: &Participant, name: &str, bell: &Bell) -> Result<Self, CreateError> {
        let [requests, replies] = names::service(name);
        let described = |name, type_name| Described {
            name,
            type_name,
            quality: QUALITY,
        };
        let of_requests = described(&requests, "std_srvs::srv::dds_::Trigger_Request_");
        let of_replies = described(&replies, "std_srvs::srv::dds_::Trigger_Response_");
        Ok(Self {
            requests: participant.reader(&of_requests, bell.rope())?,
            replies: participant.writer(&of_replies)?,
        })
    }

    /// The requests that have come. What is no CDR is none.
    pub fn take(&self, mut each: impl FnMut(Request)) {
        self.requests.take(|sample| {
            if let Ok(sample) = sample {
                each(Request::new(sample));
            }
        });
    }

    /// Answers a request.
    pub fn reply(&self, request: &Request, success: bool, message: &str) {
        let response = trigger_response(&request.before, success, message);
        // A client that does not take it has gone.
        let _ = self.replies.write(response, Some(request.identity));
    }
}

impl Request {
    fn new(sample: Sample) -> Self {
        let before = HEADER_BYTES..HEADER_BYTES + CYCLONE_BYTES;
        let before = sample.message.get(before).unwrap_or_default().to_vec();
        // Fast DDS's clients name the reader of replies, and not the request's number.
        let asks = sample.related.map(|related| related.writer_guid);
        let asks = asks.filter(|guid| *guid != GUID::GUID_UNKNOWN);
        Self {
            identity: SampleIdentity {
                writer_guid: asks.unwrap_or(sample.identity.writer_guid),
                ..sample.identity
            },
            before,
        }
    }
}
