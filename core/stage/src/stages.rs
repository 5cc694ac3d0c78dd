//! Every stage of the pipeline, once: its name, and with it its program and its unit.

/// What a stage is in the pipeline for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StageRole {
    /// Drives a sensor.
    Driver,
    /// Computes what lies between the sensors and the map.
    Computing,
    /// Reads along: the pipeline runs without it.
    Reading,
}

/// A stage of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageDescription {
    /// Name such as `odometry`.
    pub name: &'static str,
    /// What it is for.
    pub role: StageRole,
}

/// All stages in the order of the data's way, which is the order in which they are ended: each
/// gets what the one before sent last.
pub const STAGES: [StageDescription; 7] = [
    stage("radar", StageRole::Driver),
    stage("imu", StageRole::Driver),
    stage("filter", StageRole::Computing),
    stage("odometry", StageRole::Computing),
    stage("mapper", StageRole::Computing),
    stage("view", StageRole::Reading),
    stage("recorder", StageRole::Reading),
];

/// Names of the stages that compute, in that order.
pub const COMPUTING_STAGES: [&str; 3] = {
    let mut names = [""; 3];
    let (mut i, mut count) = (0, 0);
    while i < STAGES.len() {
        if matches!(STAGES[i].role, StageRole::Computing) {
            names[count] = STAGES[i].name;
            count += 1;
        }
        i += 1;
    }
    assert!(count == names.len());
    names
};

const fn stage(name: &'static str, role: StageRole) -> StageDescription {
    StageDescription { name, role }
}

impl StageDescription {
    /// Its program.
    pub fn program(&self) -> String {
        format!("randt-{}", self.name)
    }

    /// Its unit of systemd.
    pub fn unit(&self) -> String {
        format!("{}.service", self.program())
    }
}

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
            let unit = fs::read_to_string(systemd.join(stage.unit())).unwrap();
            let program = stage.program();
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
