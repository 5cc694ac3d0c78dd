//! ROS 1 bags, read and written by other code than the program's: to lay the same messages out
//! anew, or to spoil them.

use std::path::Path;

/// One message as it is stored.
#[derive(Clone, Debug)]
pub struct Raw {
    connection: u32,
    time: [u8; 8],
    pub bytes: Vec<u8>,
}

/// A bag in memory.
#[derive(Clone, Debug)]
pub struct Bag {
    /// Number, topic, type, and the whole connection record.
    connections: Vec<(u32, String, String, Vec<u8>)>,
    pub messages: Vec<Raw>,
}

/// A cloud of x, y, z and intensity.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// Sequence, stamp and frame as they are stored.
    header: Vec<u8>,
    pub points: Vec<[f32; 4]>,
}

/// How points lie in memory.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    pub step: usize,
    /// Of x, y, z, intensity.
    pub offsets: [usize; 4],
    pub big_endian: bool,
    pub row_padding: usize,
}

/// As the published data set has it.
pub const AS_PUBLISHED: Layout = Layout {
    step: 16,
    offsets: [0, 4, 8, 12],
    big_endian: false,
    row_padding: 0,
};

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Header and data of the record at `at`, and where the next one begins.
fn record(bytes: &[u8], at: usize) -> (&[u8], &[u8], usize) {
    let header = at + 4..at + 4 + u32_at(bytes, at);
    let data = header.end + 4..header.end + 4 + u32_at(bytes, header.end);
    (&bytes[header], &bytes[data.clone()], data.end)
}

fn field<'a>(header: &'a [u8], name: &str) -> &'a [u8] {
    let mut at = 0;
    while at < header.len() {
        let content = &header[at + 4..at + 4 + u32_at(header, at)];
        at += 4 + content.len();
        if let Some(value) = content
            .strip_prefix(name.as_bytes())
            .and_then(|rest| rest.strip_prefix(b"="))
        {
            return value;
        }
    }
    panic!("no field {name}");
}

fn made(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        header.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
        header.extend([name.as_bytes(), b"=", value].concat());
    }
    let length = |bytes: &[u8]| (bytes.len() as u32).to_le_bytes();
    [&length(&header), header.as_slice(), &length(data), data].concat()
}

impl Bag {
    /// The first clouds of a bag of lz4 chunks, with everything else up to the last of them.
    pub fn read(path: &Path, clouds: usize) -> Self {
        let file = std::fs::read(path).unwrap();
        let mut bag = Self {
            connections: Vec::new(),
            messages: Vec::new(),
        };
        let (mut at, mut found) = (13, 0);
        while at < file.len() && found < clouds {
            let (header, data, next) = record(&file, at);
            at = next;
            if field(header, "op") != [5] {
                continue;
            }
            assert_eq!(field(header, "compression"), b"lz4");
            let mut chunk = Vec::new();
            std::io::Read::read_to_end(&mut lz4_flex::frame::FrameDecoder::new(data), &mut chunk)
                .unwrap();
            let mut inside = 0;
            while inside < chunk.len() && found < clouds {
                let (header, data, next) = record(&chunk, inside);
                let number = u32_at(field(header, "conn"), 0) as u32;
                if field(header, "op") == [7] {
                    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
                    let (topic, kind) = (text(field(header, "topic")), text(field(data, "type")));
                    bag.connections
                        .push((number, topic, kind, chunk[inside..next].to_vec()));
                } else {
                    let time = field(header, "time").try_into().unwrap();
                    bag.messages.push(Raw {
                        connection: number,
                        time,
                        bytes: data.to_vec(),
                    });
                    found += usize::from(bag.is_cloud(bag.messages.len() - 1));
                }
                inside = next;
            }
        }
        bag
    }

    /// Whether a message is a point cloud.
    pub fn is_cloud(&self, message: usize) -> bool {
        let number = self.messages[message].connection;
        self.connections
            .iter()
            .any(|(n, _, kind, _)| *n == number && kind == "sensor_msgs/PointCloud2")
    }

    /// Lays all clouds out anew after `change` had them, the first with number 0.
    pub fn rewrite(&mut self, layout: &Layout, mut change: impl FnMut(usize, &mut Cloud)) {
        let mut number = 0;
        for message in 0..self.messages.len() {
            if self.is_cloud(message) {
                let mut cloud = Cloud::read(&self.messages[message].bytes);
                change(number, &mut cloud);
                self.messages[message].bytes = cloud.written(layout);
                number += 1;
            }
        }
    }

    /// The bag's bytes: a chunk of every hundred messages, not compressed, with indices.
    pub fn written(&self) -> Vec<u8> {
        let mut file = b"#ROSBAG V2.0\n".to_vec();
        let start = |index_at: u64, chunks: u32| {
            let count = (self.connections.len() as u32).to_le_bytes();
            let (index_at, chunks) = (index_at.to_le_bytes(), chunks.to_le_bytes());
            made(
                &[
                    ("op", &[3]),
                    ("index_pos", &index_at),
                    ("conn_count", &count),
                    ("chunk_count", &chunks),
                ],
                &[b' '; 64],
            )
        };
        let start_length = start(0, 0).len();
        file.resize(file.len() + start_length, 0);
        let mut infos: Vec<u8> = Vec::new();
        let mut chunks = 0;
        for messages in self.messages.chunks(100) {
            let mut chunk: Vec<u8> = Vec::new();
            for connection in &self.connections {
                chunk.extend(&connection.3);
            }
            let mut counts = vec![0_u32; self.connections.len()];
            for message in messages {
                counts[self
                    .connections
                    .iter()
                    .position(|c| c.0 == message.connection)
                    .unwrap()] += 1;
                let number = message.connection.to_le_bytes();
                chunk.extend(made(
                    &[("op", &[2]), ("conn", &number), ("time", &message.time)],
                    &message.bytes,
                ));
            }
            let at = (file.len() as u64).to_le_bytes();
            let size = (chunk.len() as u32).to_le_bytes();
            file.extend(made(
                &[("op", &[5]), ("compression", b"none"), ("size", &size)],
                &chunk,
            ));
            for (connection, count) in self
                .connections
                .iter()
                .zip(&counts)
                .filter(|(_, count)| **count > 0)
            {
                let (number, entries) = (connection.0.to_le_bytes(), vec![0; 12 * *count as usize]);
                let fields: [(&str, &[u8]); 4] = [
                    ("op", &[4]),
                    ("ver", &[1, 0, 0, 0]),
                    ("conn", &number),
                    ("count", &count.to_le_bytes()),
                ];
                file.extend(made(&fields, &entries));
            }
            infos.extend(made(
                &[("op", &[6]), ("ver", &[1, 0, 0, 0]), ("chunk_pos", &at)],
                &[],
            ));
            chunks += 1;
        }
        let index_at = file.len() as u64;
        self.connections
            .iter()
            .for_each(|connection| file.extend(&connection.3));
        file.extend(infos);
        file[13..13 + start_length].copy_from_slice(&start(index_at, chunks));
        file
    }
}

impl Cloud {
    /// Reads a cloud of the published layout.
    fn read(bytes: &[u8]) -> Self {
        // Sequence and stamp, then the frame's name.
        let mut at = 12 + 4 + u32_at(bytes, 12);
        let header = bytes[..at].to_vec();
        let count = u32_at(bytes, at) * u32_at(bytes, at + 4);
        let fields = u32_at(bytes, at + 8);
        at += 12;
        for _ in 0..fields {
            at += 4 + u32_at(bytes, at) + 4 + 1 + 4;
        }
        assert_eq!(
            (bytes[at], u32_at(bytes, at + 1)),
            (0, 16),
            "the published layout"
        );
        let data = &bytes[at + 13..at + 13 + 16 * count];
        let value = |point: &[u8], i: usize| {
            f32::from_le_bytes(point[4 * i..4 * i + 4].try_into().unwrap())
        };
        let points = data
            .chunks_exact(16)
            .map(|point| [0, 1, 2, 3].map(|i| value(point, i)));
        Self {
            header,
            points: points.collect(),
        }
    }

    fn written(&self, layout: &Layout) -> Vec<u8> {
        let mut out = self.header.clone();
        let put = |out: &mut Vec<u8>, value: usize| out.extend((value as u32).to_le_bytes());
        put(&mut out, 1);
        put(&mut out, self.points.len());
        put(&mut out, 5);
        for (name, offset, datatype) in [
            // A field that is not read; the others stand where the layout has them.
            ("elevation_index", 0, 2),
            ("intensity", layout.offsets[3], 7),
            ("z", layout.offsets[2], 7),
            ("y", layout.offsets[1], 7),
            ("x", layout.offsets[0], 7_u8),
        ] {
            put(&mut out, name.len());
            out.extend(name.as_bytes());
            put(&mut out, offset);
            out.push(datatype);
            put(&mut out, 1);
        }
        out.push(u8::from(layout.big_endian));
        let row = self.points.len() * layout.step + layout.row_padding;
        put(&mut out, layout.step);
        put(&mut out, row);
        put(&mut out, row);
        let begin = out.len();
        // Padding holds anything but zeros.
        out.resize(begin + row, 0xa5);
        for (i, point) in self.points.iter().enumerate() {
            for (value, offset) in point.iter().zip(layout.offsets) {
                let at = begin + i * layout.step + offset;
                let bytes = if layout.big_endian {
                    value.to_be_bytes()
                } else {
                    value.to_le_bytes()
                };
                out[at..at + 4].copy_from_slice(&bytes);
            }
        }
        out.push(1);
        out
    }
}
