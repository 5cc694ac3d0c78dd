//! Two builds whose messages differ by two swapped fields of one size refuse each other, with an
//! error that says what to do.

use crate::support::{Other, pipeline_folder};
use randt_stage::{Domain, Error, Stage, WakeReason};
use std::path::Path;

/// This build.
mod ours {
    use randt_messages::Header;

    randt_messages::plain! {
        /// A payload.
        pub struct Wheel {
            /// The beginning of every message.
            pub header: Header,
            /// Turned so far on the left, m.
            pub left_m: f64,
            /// Turned so far on the right, m.
            pub right_m: f64,
        }
    }
    randt_messages::topic! {
        /// Its topic.
        WheelTopic = "test/wheel/v1": Wheel, [(); 0];
    }
}

/// The other build: of the same size, and without the layout's hash of the same name.
mod theirs {
    use randt_messages::Header;

    randt_messages::plain! {
        /// A payload.
        pub struct Wheel {
            /// The beginning of every message.
            pub header: Header,
            /// Turned so far on the right, m.
            pub right_m: f64,
            /// Turned so far on the left, m.
            pub left_m: f64,
        }
    }
    randt_messages::topic! {
        /// Its topic.
        WheelTopic = "test/wheel/v1": Wheel, [(); 0];
    }
}

/// What the other process does: it is the stage `drive`, which publishes until it is stopped.
#[test]
fn other_build() {
    let Some(run) = pipeline_folder() else {
        return;
    };
    let mut stage = Stage::open("drive", &Domain::new("layout", Some(&run)).unwrap()).unwrap();
    let _wheels = stage.publisher::<theirs::WheelTopic>().unwrap();
    stage.running().unwrap();
    println!("ready");
    while stage.wait(&[], None).unwrap() != WakeReason::Stop {}
    stage.close().unwrap();
}

#[test]
fn builds_with_swapped_fields_refuse_each_other_and_name_the_stage_to_restart() {
    use randt_messages::Topic;
    assert_eq!(size_of::<ours::Wheel>(), size_of::<theirs::Wheel>());
    let run = tempfile::tempdir().unwrap();
    let other = Other::start("layout::other_build", run.path());
    let pid = other.pid();
    let error = attempt(run.path()).unwrap_err();
    assert!(matches!(error, Error::Layout { .. }), "{error:?}");
    let text = error.to_string();
    println!("{text}");
    for part in [
        "test/wheel/v1",
        ours::WheelTopic::TYPE_NAME,
        theirs::WheelTopic::TYPE_NAME,
        &format!("randt-drive (process {pid})"),
        &format!("restart randt-drive (process {pid})"),
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    // At every attempt.
    assert!(matches!(
        attempt(run.path()).unwrap_err(),
        Error::Layout { .. }
    ));
    other.stop();
    attempt(run.path()).unwrap();
}

/// Both ends of the topic as this build has it.
fn attempt(run: &Path) -> Result<(), Error> {
    let mut stage = Stage::open("odometer", &Domain::new("layout", Some(run))?)?;
    let _wheels = stage.subscriber::<ours::WheelTopic>()?;
    let _again = stage.publisher::<ours::WheelTopic>()?;
    stage.running()
}
