//! Gives the source that a saved state's meaning depends on a fingerprint: `RANDT_CODE`.

include!("../core/fingerprint.rs");

fn main() {
    fingerprint(&[
        "src",
        "../filter/src",
        "../core/config/src",
        "../core/geometry/src",
        "../core/messages/src",
        "../core/ndt/src",
        "../core/persist/src",
    ]);
}
