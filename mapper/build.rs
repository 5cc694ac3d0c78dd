//! Names the code that gives a snapshot of the mapper its meaning.

include!("../core/fingerprint.rs");

fn main() {
    fingerprint(&[
        "src",
        "../core/config/src",
        "../core/geometry/src",
        "../core/messages/src",
        "../core/ndt/src",
        // Libraries compute too.
        "../Cargo.lock",
    ]);
}
