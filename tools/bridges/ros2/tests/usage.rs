//! The program without anybody to speak to; with nodes: `tests/ros2.rs` of the workspace.

use std::process::Command;

#[test]
fn what_ros_would_not_take_for_a_name_is_wrong_usage() {
    for namespace in ["a b", "1st", "a//b", "robot-1"] {
        let mut bridge = Command::new(env!("CARGO_BIN_EXE_randt-ros2"));
        let ended = bridge.args(["--namespace", namespace]).output().unwrap();
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{namespace}: {said}");
        assert!(said.contains(namespace), "{said}");
    }
}
