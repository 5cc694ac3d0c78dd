//! A stage sleeps on a device as it sleeps on a topic.

use randt_stage::{Descriptor, Domain, Stage, WakeReason};
use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

#[test]
fn a_stage_wakes_when_there_is_something_to_read() {
    let run = tempfile::tempdir().unwrap();
    let domain = Domain::new("descriptor", Some(run.path())).unwrap();
    let mut stage = Stage::open("driver", &domain).unwrap();
    stage.running().unwrap();
    let (mut device, mut here) = UnixStream::pair().unwrap();
    let wait = |stage: &mut Stage, here: &UnixStream, pause| {
        let descriptor = Descriptor::new(here.as_fd()).unwrap();
        stage.wait(&[&descriptor], Some(pause)).unwrap()
    };
    let short = Duration::from_millis(20);
    assert_eq!(wait(&mut stage, &here, short), WakeReason::Timeout);

    let begin = Instant::now();
    let writer = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(50));
        device.write_all(b"data").unwrap();
        device
    });
    assert_eq!(
        wait(&mut stage, &here, Duration::from_secs(10)),
        WakeReason::Event
    );
    assert!(begin.elapsed() < Duration::from_secs(5));
    let device = writer.join().unwrap();
    // What is not read wakes again; what was read does not.
    assert_eq!(wait(&mut stage, &here, short), WakeReason::Event);
    here.read_exact(&mut [0; 4]).unwrap();
    assert_eq!(wait(&mut stage, &here, short), WakeReason::Timeout);
    // A device that is gone wakes, so that its end is noticed.
    drop(device);
    assert_eq!(
        wait(&mut stage, &here, Duration::from_secs(10)),
        WakeReason::Event
    );
    stage.close().unwrap();
}
