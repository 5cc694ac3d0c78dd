//! Logs whose messages have another build's layout.

use randt_log::{Error, LogReader, LogWriter, Options};
use randt_messages::{Message, Topic};
use std::io::Cursor;

/// One topic as two builds have it. Between them a field came, one went, one changed its kind, one
/// its offset, an array grew.
mod before {
    use randt_messages::Header;

    randt_messages::plain! {
        /// One of several.
        pub struct Post { pub x_m: f32, pub y_m: f32 }
        /// The fixed part.
        pub struct Sweep {
            pub header: Header,
            pub rate_rad_s: [f64; 3],
            pub device: u32,
            pub count: u32,
            pub gone: i64,
            pub posts: [Post; 2],
        }
        /// One return.
        pub struct Echo { pub range_m: f32, pub bin: u16, pub beam: u16 }
    }
    randt_messages::topic! {
        /// Of these.
        Sweeps = "test/sweep/v1": Sweep, [Echo; 100];
    }
}

mod now {
    use randt_messages::Header;

    randt_messages::plain! {
        /// One of several.
        pub struct Post { pub y_m: f64, pub x_m: f64 }
        /// The fixed part.
        pub struct Sweep {
            pub header: Header,
            pub device: u64,
            pub senders: u32,
            pub count: u32,
            pub rate_rad_s: [f64; 3],
            pub posts: [Post; 3],
        }
        /// One return.
        pub struct Echo { pub beam: u16, pub bin: u16, pub range_m: f32, pub intensity: f32 }
    }
    randt_messages::topic! {
        /// Of these.
        Sweeps = "test/sweep/v1": Sweep, [Echo; 100];
    }
}

/// Another topic of the same name: nothing fits, not even the header.
mod other {
    randt_messages::plain! {
        /// The fixed part.
        pub struct Sweep { pub head: randt_messages::Header }
    }
    impl AsRef<randt_messages::Header> for Sweep {
        fn as_ref(&self) -> &randt_messages::Header {
            &self.head
        }
    }
    impl AsMut<randt_messages::Header> for Sweep {
        fn as_mut(&mut self) -> &mut randt_messages::Header {
            &mut self.head
        }
    }
    /// Of these.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Sweeps;
    impl randt_messages::Topic for Sweeps {
        const NAME: &'static str = "test/sweep/v1";
        const TYPE_NAME: &'static str = "Sweeps-other";
        const MAX_ITEMS: usize = 0;
        type Head = Sweep;
        type Item = ();
    }
}

fn log<T: Topic>(messages: &[Message<T>]) -> LogReader<Cursor<Vec<u8>>> {
    let cursor = Cursor::new(Vec::new());
    let mut writer = LogWriter::new(cursor, "other.mcap", Options::default()).unwrap();
    for message in messages {
        writer.write(message.as_ref()).unwrap();
    }
    let bytes = writer.finish().unwrap().into_inner();
    LogReader::new(Cursor::new(bytes), "other.mcap").unwrap()
}

fn sweep(count: u32) -> Message<before::Sweeps> {
    let mut message = Message::<before::Sweeps>::default();
    message.head.header.stamp_ns = 1_700_000_000_000_000_000 + i64::from(count);
    message.head.header.sequence = count.into();
    message.head.rate_rad_s = [0.1, 0.2, 0.3];
    message.head.device = 7;
    message.head.count = count;
    message.head.gone = -1;
    message.head.posts = [1.5, 2.5].map(|x_m| before::Post { x_m, y_m: -x_m });
    message.items = (0..count as u16)
        .map(|bin| before::Echo {
            range_m: f32::from(bin) * 0.1,
            bin,
            beam: 3,
        })
        .collect();
    message
}

#[test]
fn fields_are_found_by_their_names_and_what_lacks_is_said() {
    let mut reader = log(&[sweep(0), sweep(5)]);
    for count in [0, 5] {
        let entry = reader.next_entry().unwrap().unwrap();
        let read = entry.decode::<now::Sweeps>().unwrap().unwrap();
        let written = sweep(count);
        assert_eq!(read.head.header, written.head.header);
        assert_eq!((read.head.device, read.head.count), (7, count));
        assert_eq!(read.head.senders, 0);
        assert_eq!(read.head.rate_rad_s, [0.1, 0.2, 0.3]);
        let posts = [1.5, 2.5, 0.0].map(|x_m| now::Post { x_m, y_m: -x_m });
        assert_eq!(read.head.posts, posts);
        let expected: Vec<now::Echo> = written
            .items
            .iter()
            .map(|echo| now::Echo {
                beam: echo.beam,
                bin: echo.bin,
                range_m: echo.range_m,
                intensity: 0.0,
            })
            .collect();
        assert_eq!(read.items, expected);
        // And as it was written.
        assert_eq!(entry.decode::<before::Sweeps>().unwrap(), Some(written));
    }
    assert!(reader.next_entry().unwrap().is_none());
    let said: Vec<String> = reader.translated().collect();
    assert_eq!(said.len(), 1, "{said:?}");
    for words in [
        "other.mcap: test/sweep/v1",
        "it has no senders, posts[2..], intensity",
        "not know its gone",
    ] {
        assert!(said[0].contains(words), "{words}: {said:?}");
    }
}

#[test]
fn a_log_of_this_build_is_not_translated() {
    let mut reader = log(&[sweep(2)]);
    while let Some(entry) = reader.next_entry().unwrap() {
        entry.decode::<before::Sweeps>().unwrap().unwrap();
    }
    assert_eq!(reader.translated().count(), 0);
}

#[test]
fn what_is_narrower_here_or_no_such_message_is_not_guessed() {
    // A number that may not fit is left out.
    let mut message = Message::<now::Sweeps>::default();
    message.head.header.stamp_ns = 4;
    message.head.device = u64::MAX;
    message.head.count = 9;
    let mut reader = log(&[message]);
    let entry = reader.next_entry().unwrap().unwrap();
    let read = entry.decode::<before::Sweeps>().unwrap().unwrap();
    assert_eq!((read.head.device, read.head.count), (0, 9));
    let said: Vec<String> = reader.translated().collect();
    assert!(said[0].contains("it has no device, gone"), "{said:?}");
    // An array that is longer there is cut, and that is said.
    assert!(said[0].contains("posts[2..]"), "{said:?}");

    // Without header it is no message of ours.
    let mut reader = log(&[Message::<other::Sweeps>::default()]);
    let entry = reader.next_entry().unwrap().unwrap();
    let refused = entry.decode::<now::Sweeps>();
    assert!(matches!(refused, Err(Error::Layout { .. })), "{refused:?}");
}
