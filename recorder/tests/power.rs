//! What a power cut and a cut file leave.

use crate::support::{
    BEGIN_NS, Drive, Faulty, Name, Random, S, Wrong, name, read, recorder, settings,
};
use randt_log::{LogReader, LogWriter, Options, copy};
use randt_recorder::Raw;
use std::collections::BTreeSet;
use std::io::Cursor;

/// Nothing older is lost.
const LOST_MAX_NS: i64 = 3 * S / 2;
/// The period of the thread's ticks.
const TICK_NS: i64 = S / 10;

/// Drives for this time; gives each message with when it was there, and when the power went.
fn drive(sink: &Faulty, seconds: i64) -> (Vec<(i64, Raw)>, Option<i64>) {
    let mut settings = settings();
    settings.file_max_ns = 4 * S;
    let mut recorder = recorder(sink.clone(), settings);
    let mut drive = Drive::new(300);
    let mut all = Vec::new();
    let mut now_ns = BEGIN_NS;
    let mut off_ns = None;
    while now_ns < BEGIN_NS + seconds * S && off_ns.is_none() {
        now_ns += TICK_NS;
        for raw in drive.until(now_ns) {
            all.push((raw.label.time_ns, raw.clone()));
            recorder.push(raw, now_ns);
        }
        recorder.tick(now_ns);
        off_ns = sink.is_off().then_some(now_ns);
    }
    if off_ns.is_none() {
        recorder.finish(now_ns);
    }
    (all, off_ns)
}

#[test]
fn of_a_power_cut_at_any_moment_the_last_second_is_lost_and_no_more() {
    let whole = Faulty::default();
    drive(&whole, 10);
    let operations = whole.operations();
    let seed = 6;
    println!("seed {seed}; {operations} operations in a drive");
    let mut random = Random(seed);
    let mut worst_ns = 0;
    for trial in 0..200 {
        let sink = Faulty::default();
        let after = 3 + random.below(operations - 3);
        sink.set(Wrong {
            power_cut_after: Some(after),
            ..Wrong::default()
        });
        let (all, off_ns) = drive(&sink, 10);
        let off_ns = off_ns.unwrap_or(BEGIN_NS + 10 * S);
        let mut there = BTreeSet::new();
        for file in sink.files().values().filter(|file| file.synced > 0) {
            there.extend(read(&file.bytes[..file.synced]));
        }
        let lost = all.iter().filter(|(_, raw)| !there.contains(&name(raw)));
        let oldest_ns = lost.map(|(at_ns, _)| off_ns - at_ns).max().unwrap_or(0);
        worst_ns = worst_ns.max(oldest_ns);
        assert!(
            oldest_ns <= LOST_MAX_NS,
            "trial {trial}: cut after {after} operations: {oldest_ns} ns"
        );
    }
    println!(
        "oldest message that was lost: {:.3} s",
        worst_ns as f64 * 1e-9
    );
    assert!(
        worst_ns > 0,
        "nothing was ever lost: was the power cut at all?"
    );
}

/// Where a chunk begins and ends, and what it holds.
type Chunk = (usize, usize, BTreeSet<Name>);

/// A file of some seconds, with its chunks.
fn file() -> (Vec<u8>, Vec<Chunk>) {
    let sink = Faulty::default();
    drive(&sink, 3);
    let bytes = sink.files().into_values().next().unwrap().bytes;
    let mut chunks = Vec::new();
    let mut at = 8;
    while at + 9 <= bytes.len() - 8 {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == 6 {
            chunks.push((at, at + 9 + length, BTreeSet::new()));
        }
        at += 9 + length;
    }
    let mut reader = LogReader::new(Cursor::new(&bytes), "t").unwrap();
    while let Some(entry) = reader.next_entry().unwrap() {
        let chunk = chunks
            .iter_mut()
            .find(|chunk| chunk.0 as u64 == entry.offset);
        let is_ours = !entry.channel.topic.starts_with("view/");
        if is_ours {
            let name = (entry.channel.topic.clone(), entry.sequence);
            chunk.unwrap().2.insert(name);
        }
    }
    (bytes, chunks)
}

/// What a file that is cut here must give.
fn expected(chunks: &[Chunk], cut: usize) -> BTreeSet<Name> {
    let whole = chunks.iter().filter(|(_, end, _)| *end <= cut);
    whole.flat_map(|(.., names)| names.clone()).collect()
}

#[test]
fn a_file_that_is_cut_anywhere_gives_every_chunk_before_the_cut() {
    let (bytes, chunks) = file();
    let chunks_of_messages = chunks.iter().filter(|chunk| !chunk.2.is_empty()).count();
    assert!(chunks_of_messages > 4, "{chunks_of_messages} chunks");
    let (begin, end) = (chunks[chunks.len() - 2].0, chunks[chunks.len() - 1].1);
    println!("{} bytes, every cut from {begin} to {end}", bytes.len());
    let mut random = Random(60);
    let anywhere = (0..1000).map(|_| 8 + random.below(bytes.len() as u64 - 8) as usize);
    for cut in (begin..=end).chain(anywhere) {
        assert_eq!(read(&bytes[..cut]), expected(&chunks, cut), "cut at {cut}");
    }
}

#[test]
fn a_cut_file_recovers_to_a_whole_one() {
    let (bytes, chunks) = file();
    let mut random = Random(600);
    for _ in 0..100 {
        let cut = 8 + random.below(bytes.len() as u64 - 8) as usize;
        let mut reader = LogReader::new(Cursor::new(&bytes[..cut]), "t").unwrap();
        reader.whole_chunks_only();
        let sink = Cursor::new(Vec::new());
        let mut writer = LogWriter::new(sink, "r", Options::default()).unwrap();
        copy(&mut reader, &mut writer, |_| true).unwrap();
        let recovered = writer.finish().unwrap().into_inner();
        assert_eq!(read(&recovered), expected(&chunks, cut), "cut at {cut}");
        let mut whole = LogReader::new(Cursor::new(&recovered), "r").unwrap();
        while whole.next_entry().unwrap().is_some() {}
        assert!(whole.damage().is_empty(), "{:?}", whole.damage());
        if cut > chunks[0].0 {
            let robot = whole.robot().unwrap();
            assert_eq!(robot.radar, Some([0.0; 3]), "cut at {cut}");
        }
    }
}
