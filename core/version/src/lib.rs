//! Version and commit of this build, for `--version`, logs and reports.
//!
//! A crate of its own, because all that depends on it is compiled anew with every commit. The
//! algorithms do not, and what is saved is not judged by it: two builds of one source read each
//! other's state.

/// The commit: the environment variable `RANDT_COMMIT` of the build; where that is not set, git's
/// `HEAD` as this crate was compiled, with `-dirty` where the working tree had changes then;
/// without git `unknown`.
pub const COMMIT: &str = env!("RANDT_COMMIT");

/// Version and commit, such as `0.2.0 (30a8848)`.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("RANDT_COMMIT"), ")");
