//! Logs that are cut or damaged.

use super::{log, read};
use randt_log::{Compression, DamageKind, LogReader};
use randt_messages::RadarScan;
use std::io::Cursor;

#[test]
fn a_log_cut_at_any_byte_gives_the_scans_before_the_cut() {
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        let whole = log(9, 40, compression);
        let (all, damage) = read(whole.clone(), 40);
        assert_eq!((all.len(), damage.len()), (9, 0));
        let mut before = 0;
        // Every byte of the compressed ones; the other is mostly the zeros of beam tables.
        let step = if compression.is_none() { 211 } else { 1 };
        for cut in (8..whole.len()).step_by(step) {
            let (sequences, damage) = read(whole[..cut].to_vec(), 40);
            assert!(
                sequences.iter().copied().eq(0..sequences.len() as u64),
                "cut at {cut}: {sequences:?}"
            );
            assert!(
                sequences.len() >= before,
                "cut at {cut}: fewer scans than at {}",
                cut - 1
            );
            assert!(
                sequences.len() == 9 || damage == [DamageKind::Cut],
                "cut at {cut}: {damage:?}"
            );
            before = sequences.len();
        }
        assert_eq!(before, 9);
    }
}

#[test]
fn a_chunk_without_a_checksum_is_left_out_where_only_whole_ones_are_wanted() {
    let whole = log(9, 400, None);
    // In the second chunk, and in the first one.
    for (cut, expected) in [(whole.len() * 60 / 100, 3), (whole.len() / 5, 0)] {
        let bytes = whole[..cut].to_vec();
        assert!(read(bytes.clone(), 400).0.len() > expected, "{cut}");
        let mut reader = LogReader::new(Cursor::new(bytes), "t").unwrap();
        reader.whole_chunks_only();
        let mut scans = 0;
        while let Some(entry) = reader.next_entry().unwrap() {
            scans += usize::from(entry.decode::<RadarScan>().unwrap().is_some());
        }
        assert_eq!(scans, expected, "{cut}");
        let damage: Vec<_> = reader.damage().iter().map(|damage| damage.kind).collect();
        assert_eq!(damage, [DamageKind::Cut]);
    }
}

#[test]
fn a_damaged_chunk_is_counted_and_its_neighbours_are_read() {
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        let mut bytes = log(9, 400, compression);
        let middle = bytes.len() * 45 / 100;
        bytes[middle] ^= 0x10;
        let (sequences, damage) = read(bytes, 400);
        assert_eq!(sequences, [0, 1, 2, 6, 7, 8]);
        assert_eq!(damage, [DamageKind::Chunk]);
    }
}

#[test]
fn behind_a_broken_length_the_next_chunk_is_found() {
    let mut bytes = log(9, 400, Some(Compression::Lz4));
    // The second chunk's record: its length becomes absurd.
    let starts: Vec<_> = (0..bytes.len() - 50)
        .filter(|&at| bytes[at] == 6 && bytes[at + 37..].starts_with(b"\x03\0\0\0lz4"))
        .collect();
    assert_eq!(starts.len(), 3);
    bytes[starts[1] + 7] = 0xff;
    let (sequences, damage) = read(bytes, 400);
    assert_eq!(sequences, [0, 1, 2, 6, 7, 8]);
    assert_eq!(damage.len(), 1);
}

#[test]
fn every_flipped_byte_is_found() {
    let bytes = log(4, 40, Some(Compression::Zstd));
    let found = |bytes: &[u8]| {
        let sums = randt_log::check_sums(bytes).unwrap();
        let Ok(mut reader) = LogReader::new(Cursor::new(bytes), "t") else {
            return true;
        };
        while reader.next_entry().unwrap().is_some() {}
        !sums.is_empty() || !reader.damage().is_empty()
    };
    assert!(!found(&bytes));
    for at in 0..bytes.len() {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0x10;
        assert!(found(&flipped), "byte {at} of {}", bytes.len());
        assert!(found(&bytes[..at]), "cut at {at}");
    }
}
