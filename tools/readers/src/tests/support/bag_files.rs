//! Bags of test messages: ROS 1, MCAP, database.

use super::TestMessage;
use std::io::Write;
use std::path::Path;

fn field(out: &mut Vec<u8>, name: &str, value: &[u8]) {
    out.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
    out.extend(name.as_bytes());
    out.push(b'=');
    out.extend(value);
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    fields
        .iter()
        .for_each(|(name, value)| field(&mut header, name, value));
    let mut out = (header.len() as u32).to_le_bytes().to_vec();
    out.extend(header);
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out
}

fn ros_time(ns: i64) -> [u8; 8] {
    let mut time = [0; 8];
    time[..4].copy_from_slice(&((ns / 1_000_000_000) as u32).to_le_bytes());
    time[4..].copy_from_slice(&((ns % 1_000_000_000) as u32).to_le_bytes());
    time
}

/// A ROS 1 bag of chunks of `per_chunk` messages.
pub fn ros1_bag(messages: &[TestMessage], compression: &str, per_chunk: usize) -> Vec<u8> {
    let mut topics: Vec<(&str, &str)> = Vec::new();
    for message in messages {
        if !topics.contains(&(message.topic, message.type_name)) {
            topics.push((message.topic, message.type_name));
        }
    }
    let connection = |number: usize| {
        let (topic, type_name) = topics[number];
        let mut data = Vec::new();
        field(&mut data, "topic", topic.as_bytes());
        field(&mut data, "type", type_name.as_bytes());
        field(&mut data, "md5sum", b"*");
        record(
            &[
                ("op", &[7]),
                ("conn", &(number as u32).to_le_bytes()),
                ("topic", topic.as_bytes()),
            ],
            &data,
        )
    };
    let mut bag = b"#ROSBAG V2.0\n".to_vec();
    let bag_header = |index_at: u64, chunks: u32| {
        let fields: [(&str, &[u8]); 4] = [
            ("op", &[3]),
            ("index_pos", &index_at.to_le_bytes()),
            ("conn_count", &(topics.len() as u32).to_le_bytes()),
            ("chunk_count", &chunks.to_le_bytes()),
        ];
        record(&fields, &[b' '; 100])
    };
    let header_at = bag.len();
    bag.extend(bag_header(0, 0));
    let mut infos = Vec::new();
    for part in messages.chunks(per_chunk) {
        let mut inside = Vec::new();
        let mut counts = vec![0_u32; topics.len()];
        for message in part {
            let number = topics
                .iter()
                .position(|t| *t == (message.topic, message.type_name))
                .unwrap();
            if counts[number] == 0 {
                inside.extend(connection(number));
            }
            counts[number] += 1;
            let conn = (number as u32).to_le_bytes();
            let time = ros_time(message.arrival_ns);
            inside.extend(record(
                &[("op", &[2]), ("conn", &conn), ("time", &time)],
                &message.bytes,
            ));
        }
        let stored = match compression {
            "none" => inside.clone(),
            "bz2" => {
                let mut encoder =
                    bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
                encoder.write_all(&inside).unwrap();
                encoder.finish().unwrap()
            }
            "lz4" => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(&inside).unwrap();
                encoder.finish().unwrap()
            }
            other => panic!("{other}"),
        };
        let at = bag.len() as u64;
        let size = (inside.len() as u32).to_le_bytes();
        bag.extend(record(
            &[
                ("compression", compression.as_bytes()),
                ("op", &[5]),
                ("size", &size),
            ],
            &stored,
        ));
        for (number, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
            let conn = (number as u32).to_le_bytes();
            let fields: [(&str, &[u8]); 4] = [
                ("op", &[4]),
                ("ver", &[1, 0, 0, 0]),
                ("conn", &conn),
                ("count", &count.to_le_bytes()),
            ];
            bag.extend(record(&fields, &vec![0; 12 * *count as usize]));
        }
        infos.push(record(
            &[
                ("op", &[6]),
                ("ver", &[1, 0, 0, 0]),
                ("chunk_pos", &at.to_le_bytes()),
            ],
            &[],
        ));
    }
    let index_at = bag.len() as u64;
    (0..topics.len()).for_each(|number| bag.extend(connection(number)));
    infos.iter().for_each(|info| bag.extend(info));
    let header = bag_header(index_at, infos.len() as u32);
    bag[header_at..header_at + header.len()].copy_from_slice(&header);
    bag
}

fn ros2_type(type_name: &str) -> String {
    type_name.replace('/', "/msg/")
}

/// The same messages as an MCAP file; they must be serialised as CDR.
pub fn mcap_bag(messages: &[TestMessage], chunk_size: u64) -> Vec<u8> {
    let mut writer = mcap::WriteOptions::new()
        .chunk_size(Some(chunk_size))
        .create(std::io::Cursor::new(Vec::new()))
        .unwrap();
    for message in messages {
        let schema = writer
            .add_schema(&ros2_type(message.type_name), "ros2msg", b"")
            .unwrap();
        let channel = writer
            .add_channel(schema, message.topic, "cdr", &Default::default())
            .unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: message.arrival_ns as u64,
            publish_time: message.arrival_ns as u64,
        };
        writer
            .write_to_known_channel(&header, &message.bytes)
            .unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// The same messages as a database; they must be serialised as CDR.
pub fn database_bag(messages: &[TestMessage], path: &Path) {
    let connection = rusqlite::Connection::open(path).unwrap();
    connection
        .execute_batch(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT);
             CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
             CREATE INDEX timestamp_idx ON messages (timestamp ASC);
             BEGIN",
        )
        .unwrap();
    let mut topics: Vec<&str> = Vec::new();
    for message in messages {
        if !topics.contains(&message.topic) {
            topics.push(message.topic);
            let row = (
                topics.len() as i64,
                message.topic,
                ros2_type(message.type_name),
                "cdr",
                "",
            );
            connection
                .execute("INSERT INTO topics VALUES (?1, ?2, ?3, ?4, ?5)", row)
                .unwrap();
        }
        let topic = topics.iter().position(|t| *t == message.topic).unwrap() + 1;
        connection
            .execute(
                "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)",
                (topic as i64, message.arrival_ns, &message.bytes),
            )
            .unwrap();
    }
    connection.execute_batch("COMMIT").unwrap();
}
