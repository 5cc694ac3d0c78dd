//! What the project stands on: licences, one version of each crate, and who may use what.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// Licences that ask for no more than their notice.
const LICENCES: &[&str] = &[
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
    "bzip2-1.0.6",
];

/// Crates under another licence that asks for no more as long as they are used as they are.
const EXCEPTIONS: &[(&str, &str)] = &[
    // Copyleft by file: changes to its own files would have to be published.
    ("serialport", "MPL-2.0"),
    ("option-ext", "MPL-2.0"),
    // Data: asks for its text where the data are given away, which the notices are for.
    ("webpki-roots", "CDLA-Permissive-2.0"),
];

/// Of crates that only the link has in another version.
const ZENOH_BEHIND: &str = "some of zenoh's crates are releases behind";

/// Crates that are here in several versions, with the reason.
const SEVERAL_VERSIONS: &[(&str, &str)] = &[
    (
        "bit-vec",
        "rcgen's reader of certificates (yasna) is a release behind RustDDS",
    ),
    ("bitflags", "serialport is a release behind"),
    (
        "darling",
        "build time only: enumset's derive macros are a release behind ratatui's",
    ),
    ("darling_core", "comes with darling"),
    ("darling_macro", "comes with darling"),
    (
        "embedded-io",
        "optional traits of postcard, of both ages: never built",
    ),
    (
        "equator",
        "assertions of faer, whose kernels for small products (nano-gemm) are a release behind",
    ),
    ("equator-macro", "comes with equator"),
    (
        "glam",
        "optional conversions of nalgebra: in the lock file, never built",
    ),
    (
        "itertools",
        "build time only in the older release: bindgen's, for iceoryx2",
    ),
    ("nix", "serialport is a release behind ctrlc"),
    ("miniz_oxide", "png is a release behind flate2"),
    ("shlex", "build time only: bindgen is a release behind cc"),
    (
        "syn",
        "build time only: derive macros move to version 3 one by one",
    ),
    ("thiserror", "cdr-encoding, of rustdds, is a release behind"),
    ("thiserror-impl", "comes with thiserror"),
    (
        "toml_datetime",
        "build time only in the newer release: comes with toml_edit, for derive macros",
    ),
    ("winnow", "iceoryx2's toml is a release behind ours"),
    ("base64", ZENOH_BEHIND),
    ("block-buffer", ZENOH_BEHIND),
    ("cpufeatures", ZENOH_BEHIND),
    ("crypto-common", ZENOH_BEHIND),
    ("digest", ZENOH_BEHIND),
    ("foldhash", ZENOH_BEHIND),
    ("getrandom", ZENOH_BEHIND),
    ("hashbrown", ZENOH_BEHIND),
    ("indexmap", ZENOH_BEHIND),
    ("jiff", ZENOH_BEHIND),
    ("jiff-core", ZENOH_BEHIND),
    ("lz4_flex", ZENOH_BEHIND),
    ("rand", ZENOH_BEHIND),
    ("rand_core", ZENOH_BEHIND),
    ("schemars", ZENOH_BEHIND),
    ("socket2", ZENOH_BEHIND),
    ("spin", ZENOH_BEHIND),
    ("toml_datetime", ZENOH_BEHIND),
    ("twox-hash", ZENOH_BEHIND),
];

/// Crates with a price in size, build time or determinism, and who may use them.
const USERS: &[(&str, &[&str])] = &[
    (
        "anyhow",
        &[
            "randt",
            "randt-examples",
            "randt-lab",
            "randt-link",
            "randt-python",
            "randt-ros1",
        ],
    ),
    ("base64", &["randt-view"]),
    ("bzip2", &["randt-readers"]),
    (
        "clap",
        &[
            "randt",
            "randt-config",
            "randt-examples",
            "randt-filter",
            "randt-imu",
            "randt-lab",
            "randt-link",
            "randt-mapper",
            "randt-odometry",
            "randt-python",
            "randt-radar",
            "randt-recorder",
            "randt-ros1",
            "randt-ros2",
            "randt-stage",
            "randt-view",
        ],
    ),
    ("clap_complete", &["randt-stage"]),
    ("clap_mangen", &["randt-stage"]),
    ("csv", &["randt-lab"]),
    ("ctrlc", &["randt"]),
    ("faer", &["randt-mapper"]),
    ("foxglove", &["randt-foxglove-schemas"]),
    ("iceoryx2", &["randt-stage"]),
    ("indicatif", &["randt", "randt-lab"]),
    ("libloading", &["randt-imu"]),
    ("lz4_flex", &["randt-readers"]),
    ("mcap", &["randt-log", "randt-readers"]),
    ("memmap2", &["randt-stage"]),
    ("nix", &["randt-radar", "randt-ros2", "randt-stage"]),
    ("plotters", &["randt-evaluation"]),
    ("png", &["randt", "randt-radar", "randt-readers"]),
    ("pyo3", &["randt-python"]),
    ("ratatui", &["randt"]),
    ("rcgen", &["randt-link"]),
    ("rusqlite", &["randt-readers"]),
    ("rustdds", &["randt-ros2"]),
    (
        "rustix",
        &[
            "randt",
            "randt-emulator",
            "randt-imu",
            "randt-radar",
            "randt-recorder",
            "randt-ros1",
            "randt-ros2",
            "randt-stage",
        ],
    ),
    ("serialport", &["randt-imu"]),
    ("toml", &["randt-config"]),
    ("tracing", &["randt-link"]),
    ("tungstenite", &["randt-view"]),
    ("wide", &["randt-ndt"]),
    ("zenoh", &["randt-link"]),
];

/// Crates without I/O, and all that they may use.
const PURE: &[(&str, &[&str])] = &[
    ("randt-geometry", &["libm", "nalgebra", "randt-persist"]),
    ("randt-messages", &["bytemuck"]),
    (
        "randt-ndt",
        &["nalgebra", "randt-geometry", "randt-persist", "wide"],
    ),
    (
        "randt-persist",
        &["bytemuck", "crc32fast", "nalgebra", "thiserror"],
    ),
    ("randt-version", &[]),
];

/// The machines we build for.
const PLATFORMS: [&str; 2] = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"];

/// What cargo knows of all packages, ours and others'.
fn metadata() -> Vec<Value> {
    let run = |offline: &[&str]| {
        Command::new(env!("CARGO"))
            .args(["metadata", "--locked", "--format-version", "1"])
            .args(PLATFORMS.iter().flat_map(|p| ["--filter-platform", p]))
            .args(offline)
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
            .output()
            .unwrap()
    };
    // After a build everything is on the disk; a package of the other machine may not be.
    let mut output = run(&["--offline"]);
    if !output.status.success() {
        output = run(&[]);
    }
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "cargo metadata: {text}");
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

fn text<'a>(package: &'a Value, key: &str) -> &'a str {
    package[key].as_str().unwrap_or_default()
}

/// Whether a licence expression (SPDX, or the older form with slashes) can be met by the list.
fn allowed(expression: &str) -> bool {
    let spaced = expression
        .replace('/', " OR ")
        .replace('(', " ( ")
        .replace(')', " ) ");
    let mut tokens: Vec<&str> = spaced.split_whitespace().rev().collect();
    any_of(&mut tokens) && tokens.is_empty()
}

/// `a OR b`; the tokens' next one is the last.
fn any_of(tokens: &mut Vec<&str>) -> bool {
    let mut holds = all_of(tokens);
    while tokens.pop_if(|token| *token == "OR").is_some() {
        holds |= all_of(tokens);
    }
    holds
}

/// `a AND b`.
fn all_of(tokens: &mut Vec<&str>) -> bool {
    let mut holds = one(tokens);
    while tokens.pop_if(|token| *token == "AND").is_some() {
        holds &= one(tokens);
    }
    holds
}

/// A licence, perhaps with an exception, or a bracket.
fn one(tokens: &mut Vec<&str>) -> bool {
    if tokens.pop_if(|token| *token == "(").is_some() {
        return any_of(tokens) & tokens.pop_if(|token| *token == ")").is_some();
    }
    let mut name = tokens.pop().unwrap_or_default().to_owned();
    if tokens.pop_if(|token| *token == "WITH").is_some() {
        name = format!("{name} WITH {}", tokens.pop().unwrap_or_default());
    }
    LICENCES.contains(&name.as_str())
}

#[test]
fn licence_expressions_are_understood() {
    for good in [
        "MIT",
        "MIT/Apache-2.0",
        "GPL-3.0 OR MIT",
        "(MIT OR GPL-3.0) AND Unicode-3.0",
        "Apache-2.0 WITH LLVM-exception OR GPL-2.0",
    ] {
        assert!(allowed(good), "{good}");
    }
    for bad in [
        "",
        "GPL-3.0",
        "MIT AND GPL-3.0",
        "MIT (",
        "MIT MIT",
        "Apache-2.0 WITH X",
    ] {
        assert!(!allowed(bad), "{bad}");
    }
}

#[test]
fn dependencies_are_as_agreed() {
    let packages = metadata();
    let mut wrong = Vec::new();
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in &packages {
        let name = text(package, "name");
        versions
            .entry(name)
            .or_default()
            .insert(text(package, "version"));
        let licence = text(package, "license");
        if !allowed(licence) && !EXCEPTIONS.contains(&(name, licence)) {
            wrong.push(format!("{name}: licence {licence:?} is not in LICENCES"));
        }
        // Ours have no source: they are here.
        if !package["source"].is_null() {
            continue;
        }
        for dependency in package["dependencies"].as_array().unwrap() {
            let used = text(dependency, "name");
            if dependency["kind"].as_str() == Some("dev") {
                continue;
            }
            for (_, users) in USERS.iter().filter(|(of, _)| *of == used) {
                if !users.contains(&name) {
                    wrong.push(format!("{name} uses {used}, which is for {users:?}"));
                }
            }
            for (_, may) in PURE.iter().filter(|(of, _)| *of == name) {
                if !may.contains(&used) {
                    wrong.push(format!("{name} uses {used}, it may use {may:?} only"));
                }
            }
        }
    }
    for (name, versions) in &versions {
        let reason = SEVERAL_VERSIONS.iter().find(|(of, _)| of == name);
        match (versions.len(), reason) {
            (1, Some(_)) => wrong.push(format!("{name}: one version now, strike it off the list")),
            (2.., None) => wrong.push(format!("{name}: versions {versions:?}")),
            _ => {}
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// A program that computes offline contains neither shared memory nor the process shell.
#[test]
fn the_libraries_do_without_the_process_shell() {
    for package in [
        "randt-filter",
        "randt-odometry",
        "randt-mapper",
        "randt-recorder",
    ] {
        let output = Command::new(env!("CARGO"))
            .args(["tree", "--locked", "--offline", "--package", package])
            .args([
                "--no-default-features",
                "--edges",
                "normal",
                "--prefix",
                "none",
            ])
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
            .output()
            .unwrap();
        let tree = String::from_utf8_lossy(&output.stdout);
        assert!(tree.contains("randt-messages"), "{output:?}");
        for unwanted in ["iceoryx2", "randt-stage", "clap"] {
            assert!(
                !tree.contains(unwanted),
                "{package} needs {unwanted}:\n{tree}"
            );
        }
    }
}
