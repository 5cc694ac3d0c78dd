//! Every stage of the pipeline, once: its name, and with it its program (`randt-NAME`) and its
//! unit.

/// Names of all stages in the order of the data's way, which is the order in which they are ended:
/// each gets what the one before sent last.
pub const STAGES: [&str; 7] = [
    "radar", "imu", "filter", "odometry", "mapper", "view", "recorder",
];

/// Those that compute what lies between the sensors and the map, in that order.
pub const COMPUTING_STAGES: [&str; 3] = [STAGES[2], STAGES[3], STAGES[4]];

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    #[test]
    fn every_stage_has_a_unit_and_is_packaged() {
        let systemd = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../systemd");
        let packaged = fs::read_to_string(systemd.join("package/programs")).unwrap();
        for stage in STAGES {
            let program = format!("randt-{stage}");
            let unit = fs::read_to_string(systemd.join(format!("{program}.service"))).unwrap();
            assert!(
                unit.contains(&format!("ExecStart=/usr/bin/{program} ")),
                "{program}"
            );
            assert!(packaged.lines().any(|line| line == program), "{program}");
        }
        // The rest is the command line.
        let stages = packaged.lines().filter(|line| line.starts_with("randt-"));
        assert_eq!(stages.count(), STAGES.len());
    }
}
