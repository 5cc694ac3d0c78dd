//! What the program refuses before it speaks to anybody; with two machines: `tests/link.rs` of the
//! workspace.
#![allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]

use std::fs;
use std::process::{Command, Output};

fn randt_link(args: &[&str]) -> Output {
    let mut link = Command::new(env!("CARGO_BIN_EXE_randt-link"));
    link.args(args).output().unwrap()
}

#[test]
fn without_keys_only_this_machine_is_an_address() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("link.toml");
    for address in ["192.168.7.1:7447", "0.0.0.0:7447", "[::]:7447"] {
        let text = format!("[link]\nrole = \"base\"\nrobot = \"spot\"\naddress = \"{address}\"\n");
        fs::write(&file, text).unwrap();
        let ended = randt_link(&["--robot", file.to_str().unwrap()]);
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(78), "{address}: {said}");
        assert!(
            said.contains(address) && said.contains("link.keys"),
            "{said}"
        );
    }
}

#[test]
fn keys_that_are_there_stay() {
    let folder = tempfile::tempdir().unwrap();
    let keys = folder.path().join("keys");
    let make = || randt_link(&["keys", keys.to_str().unwrap(), "spot"]).status;
    assert!(make().success());
    let own = fs::read(keys.join("spot/own.key")).unwrap();
    assert_eq!(make().code(), Some(1));
    assert_eq!(fs::read(keys.join("spot/own.key")).unwrap(), own);
}
