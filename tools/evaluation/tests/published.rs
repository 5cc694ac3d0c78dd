//! The paper's published trajectories give its published figures, to the last digit printed.

use randt_evaluation::{Trajectory, evaluate};
use std::path::{Path, PathBuf};

/// The folder of the recordings; `None` where there is none (an error under CI).
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("RANDT_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(
        std::env::var("CI").as_deref() != Ok("true"),
        "no data at {}: set RANDT_DATA",
        folder.display()
    );
    println!("skipped: no data");
    None
}

/// The value behind a name in a published result.
fn published(text: &str, name: &str) -> String {
    let line = text.lines().find(|line| line.starts_with(name)).unwrap();
    line.split(", ").nth(1).unwrap().trim().to_owned()
}

#[test]
fn the_published_figures_are_met_to_five_decimals() {
    let Some(data) = data() else { return };
    let mut files = 0;
    for sequence in ["10-11-46", "10-12-32", "16-13-09", "18-15-20"] {
        for kind in ["slam", "odom"] {
            let folder = data.join("trajectories/randt").join(sequence).join(kind);
            let read = |name| Trajectory::read(folder.join(name).to_str().unwrap()).unwrap();
            let found = evaluate(&read("est.txt"), &read("gt.txt")).unwrap();
            let text = std::fs::read_to_string(folder.join("published_result.txt")).unwrap();
            for (name, value) in [
                ("Trans.err.(%)", found.kitti_translation_percent),
                ("Rot.err.(deg/100m)", found.kitti_rotation_deg_per_100m),
                ("ATE(m)", found.ate_rmse_m),
                ("RPE(m)", found.rpe_translation_mean_m),
                ("RPE(deg)", found.rpe_rotation_mean_deg),
            ] {
                let value = format!("{:.5}", value.unwrap());
                assert_eq!(value, published(&text, name), "{sequence} {kind} {name}");
            }
            assert_eq!(found.coverage, 1.0);
            files += 1;
        }
    }
    assert_eq!(files, 8);
}
