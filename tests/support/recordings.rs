//! Where the recordings lie: `RANDT_DATA`, or `shared/data` beside the checkout.

use std::path::{Path, PathBuf};

/// A recording, or `None` where there are none; CI must have them.
pub fn recording(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("RANDT_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    let ci = std::env::var("CI").is_ok_and(|ci| ci == "true");
    assert!(!ci, "{} is absent: set RANDT_DATA", path.display());
    println!("skipped: no data");
    None
}
