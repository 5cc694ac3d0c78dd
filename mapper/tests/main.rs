//! The mapper as a library, on simulated drives. One program, so that it is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test says by panicking what is wrong"
)]

mod alike;
mod changes;
mod compaction;
mod components;
mod consistency;
mod grid;
mod growth;
mod journal;
mod journal_file;
mod laps;
mod publication;
mod snapshots;
mod undisturbed;

/// What the mapper holds is counted.
#[global_allocator]
static ALLOCATOR: randt_counting_allocator::CountingAllocator =
    randt_counting_allocator::CountingAllocator;
