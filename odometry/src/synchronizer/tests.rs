//! How scans, samples and twists wait for each other.

use super::*;
use randt_messages::Message;

const SWEEP_NS: i64 = 200_000_000;

fn sweep(number: i64) -> Message<RadarPoints> {
    let mut scan = Message::<RadarPoints>::default();
    let head = &mut *scan.head;
    (head.scan_epoch, head.scan_sequence) = (7, number as u64);
    head.scan_published_ns = number * SWEEP_NS + 1000;
    (head.sweep.begin_ns, head.sweep.end_ns) = ((number - 1) * SWEEP_NS, number * SWEEP_NS);
    scan
}

fn sample(stamp_ns: i64) -> ImuSample {
    let mut sample = ImuSample::default();
    (sample.header.stamp_ns, sample.header.published_ns) = (stamp_ns, stamp_ns + 1);
    sample
}

/// One that scans do wait in, and the gyro's part.
fn synchronizer() -> (ScanImuSynchronizer, GyroIntegrator, Counters) {
    let config = randt_config::Config::default();
    (
        ScanImuSynchronizer::new(&config.odometry),
        GyroIntegrator::new(&config.attitude, &config.robot, &config.odometry),
        Counters::default(),
    )
}

#[test]
fn a_scan_waits_until_a_sample_covers_it() {
    let (mut waiting, gyro, mut counters) = synchronizer();
    let end_ns = waiting.push_scan(sweep(3).as_ref(), &mut counters);
    assert_eq!(end_ns, Some(3 * SWEEP_NS));
    waiting.push_imu(&sample(2 * SWEEP_NS), &mut counters);
    assert!(waiting.take_covered(Some(&gyro)).is_none());
    waiting.push_imu(&sample(3 * SWEEP_NS), &mut counters);
    let taken = waiting.take_covered(Some(&gyro)).unwrap();
    assert_eq!((taken.scan.head.scan_sequence, taken.samples), (3, 2));
    assert_eq!(waiting.waiting_for_ns(), None);
    // Without an IMU nothing waits.
    waiting.push_scan(sweep(4).as_ref(), &mut counters);
    assert_eq!(waiting.take_covered(None).unwrap().samples, 0);
}

#[test]
fn the_wait_ends_by_a_later_scan_or_for_want_of_room() {
    let (mut waiting, gyro, mut counters) = synchronizer();
    waiting.push_scan(sweep(3).as_ref(), &mut counters);
    assert!(!waiting.is_wait_over(3 * SWEEP_NS));
    assert!(waiting.is_wait_over(4 * SWEEP_NS));
    (1..PENDING_MAX).for_each(|_| {
        assert!(!waiting.is_wait_over(3 * SWEEP_NS));
        waiting.push_scan(sweep(3).as_ref(), &mut counters);
    });
    assert!(waiting.is_wait_over(3 * SWEEP_NS));
    let deadline_ns = waiting.deadline_ns().unwrap();
    assert_eq!(waiting.take_uncovered(Some(&gyro)).unwrap().samples, 0);
    // A sample that was published in time overtook nothing; it was overtaken.
    waiting.push_imu(&sample(deadline_ns - 1), &mut counters);
    assert_eq!(counters.scans_imu_overtaken, 1);
}

#[test]
fn a_sweep_without_possible_times_is_rejected() {
    let (mut waiting, _, mut counters) = synchronizer();
    let mut scan = sweep(3);
    scan.head.sweep.end_ns = -1;
    assert_eq!(waiting.push_scan(scan.as_ref(), &mut counters), None);
    assert_eq!(counters.scans_rejected, 1);
    let id = MessageId {
        epoch: 7,
        sequence: 3,
    };
    assert_eq!(waiting.last_scan(), Some(id));
}

#[test]
fn what_waits_survives_its_process() {
    let (mut whole, gyro, mut counters) = synchronizer();
    whole.push_scan(sweep(3).as_ref(), &mut counters);
    whole.push_imu(&sample(2 * SWEEP_NS), &mut counters);
    whole.advance(2 * SWEEP_NS, Some(&gyro));
    let mut bytes = vec![0; 1 << 20];
    whole.save(&mut Writer::new(&mut bytes));
    let (mut restored, ..) = synchronizer();
    restored.restore(&mut Reader::new(&bytes)).unwrap();
    assert_eq!(restored.last_end_ns(), Some(2 * SWEEP_NS));
    assert_eq!(restored.deadline_ns(), whole.deadline_ns());
    assert_eq!(
        (restored.imu_len(), restored.last_imu()),
        (1, whole.last_imu())
    );
    let scan = restored.take_uncovered(Some(&gyro)).unwrap().scan;
    assert_eq!(scan.head.scan_sequence, 3);
}

#[test]
fn a_scan_waits_for_twists_where_there_were_some_and_no_longer_than_for_the_imu() {
    let (mut waiting, gyro, mut counters) = synchronizer();
    let twist = |stamp_ns: i64| {
        let mut twist = Twist::default();
        twist.header.stamp_ns = stamp_ns;
        twist
    };
    (0..50).for_each(|i| waiting.push_twist(&twist(i * SWEEP_NS / 10), &mut counters));
    waiting.push_scan(sweep(6).as_ref(), &mut counters);
    waiting.push_imu(&sample(6 * SWEEP_NS), &mut counters);
    assert!(waiting.take_covered(Some(&gyro)).is_none());
    assert!(!waiting.is_wait_over(6 * SWEEP_NS) && waiting.is_wait_over(7 * SWEEP_NS));
    waiting.push_twist(&twist(6 * SWEEP_NS), &mut counters);
    let taken = waiting.take_covered(Some(&gyro)).unwrap();
    assert_eq!((taken.samples, taken.twists), (1, 51));
    (0..51).for_each(|_| assert!(waiting.pop_twist().is_some()));
    // They stay away: what the IMU covers is used as if it had not waited.
    waiting.push_scan(sweep(7).as_ref(), &mut counters);
    waiting.push_imu(&sample(7 * SWEEP_NS), &mut counters);
    waiting.push_imu(&sample(8 * SWEEP_NS), &mut counters);
    assert!(waiting.take_covered(Some(&gyro)).is_none());
    let taken = waiting.take_uncovered(Some(&gyro)).unwrap();
    assert_eq!((taken.samples, taken.twists), (2, 0));
    waiting.push_twist(&twist(-1), &mut counters);
    assert_eq!(counters.twists_rejected, 1);
}
