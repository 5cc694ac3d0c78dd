//! The configuration in the units that the recorder computes with.

use crate::Settings;
use randt_config::Record;
use randt_log::{Compression, Options};

impl Settings {
    /// As configured.
    pub fn from_config(record: &Record) -> Self {
        let ns = |seconds: f64| (seconds * 1e9) as i64;
        let leave_out = record.leave_out.split_whitespace();
        Self {
            free_min_bytes: (record.free_min_gb * 1e9) as u64,
            delete_oldest: record.delete_oldest,
            file_max_bytes: (record.file_max_mb * 1e6) as u64,
            file_max_ns: ns(record.file_max_s),
            chunk_ns: ns(record.chunk_s),
            leave_out: leave_out.map(str::to_owned).collect(),
            log: Options {
                compression: Some(Compression::Zstd),
                level: record.zstd_level,
                written_by: format!("randt-recorder {}", randt_version::VERSION),
                ..Options::default()
            },
        }
    }
}
