//! A simulated drive: same seed same bits, truth that fits itself, sensors on their right sides.

use nalgebra::Vector2;
use randt_geometry::{Pose2, elementary};
use randt_messages::{ImuSampleTopic, MessageRef, TruthPoseTopic};
use randt_simulator::{
    Drive, Event, Material, MotionProfile, Robot, START_NS, Simulation, Wall, World,
};

fn bytes(scans: u64, seed: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    for event in Simulation::new(&World::building(), Robot::default(), scans, seed) {
        match event {
            Event::Scan(scan) => scan.as_ref().write_bytes(&mut bytes),
            Event::Imu(sample) => MessageRef::<ImuSampleTopic> {
                head: &sample,
                items: &[],
            }
            .write_bytes(&mut bytes),
            Event::Twist(_) => continue,
            Event::Truth(pose) => MessageRef::<TruthPoseTopic> {
                head: &pose,
                items: &[],
            }
            .write_bytes(&mut bytes),
        }
    }
    bytes
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
    let (once, again, other) = (bytes(20, 1), bytes(20, 1), bytes(20, 2));
    assert!(once == again);
    assert!(once != other);
    // More sweeps do not change the first ones.
    assert!(bytes(21, 1)[..once.len() / 2] == once[..once.len() / 2]);
}

#[test]
fn every_sensor_keeps_its_rate_and_the_truth_comes_before_its_sweep() {
    let (mut scans, mut samples) = (0_u64, 0_u64);
    let (mut truth_ns, mut sample_ns) = (i64::MIN, i64::MIN);
    for event in Simulation::new(&World::building(), Robot::default(), 25, 3) {
        let stamp_ns = event.stamp_ns();
        match event {
            Event::Scan(scan) => {
                let sweep = &scan.head.sweep;
                assert_eq!(scan.head.header.sequence, scans);
                assert_eq!(stamp_ns, truth_ns, "a sweep comes right after its truth");
                assert_eq!(sweep.end_ns, stamp_ns);
                assert_eq!(sweep.end_ns - sweep.begin_ns, 200_000_000);
                assert_eq!(sweep.beams().len(), 220);
                for (index, beam) in sweep.beams().iter().enumerate() {
                    assert!((sweep.begin_ns..sweep.end_ns).contains(&beam.stamp_ns));
                    for item in &scan.items[sweep.returns_of(index, scan.items.len())] {
                        assert_eq!(usize::from(item.beam), index);
                    }
                }
                scans += 1;
            }
            Event::Imu(sample) => {
                assert_eq!(sample.header.sequence, samples);
                assert!(stamp_ns > sample_ns && sample.arrival_ns > stamp_ns);
                sample_ns = stamp_ns;
                samples += 1;
            }
            Event::Twist(_) => panic!("a robot without wheel odometry"),
            Event::Truth(_) => {
                assert!(stamp_ns > truth_ns);
                truth_ns = stamp_ns;
            }
        }
    }
    // 25 sweeps from 0.05 s on, and the IMU a little longer.
    assert_eq!(scans, 25);
    assert!((1262..=1272).contains(&samples), "{samples}");
}

#[test]
fn velocity_and_acceleration_are_the_poses_derivatives() {
    let mut drive = Drive::new(&World::building(), MotionProfile::default(), 5);
    let step_ns = 100_000;
    let step_s = 1e-4;
    let (mut fastest, mut quickest_turn) = (0.0_f64, 0.0_f64);
    let mut slip = 0.0_f64;
    // Odd instants, in the middle between two of the driver's decisions.
    for index in 0..3000_i64 {
        let time_ns = index * 40_000_000 + 5_000_000;
        let before = drive.at(time_ns - step_ns);
        let now = drive.at(time_ns);
        let after = drive.at(time_ns + step_ns);
        let moved = before.pose2().between(&after.pose2()).log() / (2.0 * step_s);
        for (axis, value) in moved.iter().enumerate() {
            assert!(
                (value - now.velocity[axis]).abs() < 1e-6,
                "at {index}: {moved} {:?}",
                now.velocity
            );
        }
        // World velocities, differentiated and turned into the robot's frame.
        let world = |state: &randt_simulator::MotionState| {
            state.pose2().rotation() * Vector2::new(state.velocity[0], state.velocity[1])
        };
        let change = (world(&after) - world(&before)) / (2.0 * step_s);
        let change = now.pose2().rotation().transpose() * change;
        for axis in 0..2 {
            assert!(
                (change[axis] - now.acceleration[axis]).abs() < 1e-5,
                "at {index}: {change}"
            );
        }
        fastest = fastest.max(now.velocity[0]);
        quickest_turn = quickest_turn.max(now.velocity[2].abs());
        slip = slip.max(now.velocity[1].abs());
    }
    assert!((0.9..=1.0).contains(&fastest), "{fastest} m/s");
    assert!(
        (0.5..=0.7).contains(&quickest_turn),
        "{quickest_turn} rad/s"
    );
    assert!(slip > 0.02, "{slip} m/s sideways");
}

#[test]
fn the_gyro_and_the_accelerometer_follow_the_truth() {
    let mut robot = Robot::default();
    // A perfect IMU.
    robot.imu.rate_noise_rad_s = 0.0;
    robot.imu.rate_bias_rad_s = 0.0;
    robot.imu.rate_bias_walk = 0.0;
    robot.imu.vibration_rad_s = 0.0;
    let (mut yaw, mut last_ns, mut first_yaw, mut truth) = (0.0, None, None, None);
    let mut gravity = (0.0, 0.0);
    for event in Simulation::new(&World::building(), robot, 150, 4) {
        match event {
            Event::Imu(sample) => {
                let stamp_ns = sample.header.stamp_ns;
                let dt = last_ns.map_or(0.0, |last: i64| (stamp_ns - last) as f64 * 1e-9);
                yaw += sample.rate_rad_s[2] * dt;
                last_ns = Some(stamp_ns);
                gravity = (gravity.0 + sample.acceleration_m_s2[2], gravity.1 + 1.0);
            }
            Event::Truth(pose) => {
                first_yaw.get_or_insert(pose.pose[2]);
                truth = Some(pose);
            }
            Event::Scan(_) | Event::Twist(_) => {}
        }
    }
    let turned = truth.unwrap().pose[2] - first_yaw.unwrap();
    assert!(
        elementary::wrap(turned - yaw).abs() < 0.01,
        "{turned} {yaw}"
    );
    assert!((gravity.0 / gravity.1 - 9.807_f64).abs() < 0.1);
}

/// A robot that stands at the origin and faces along x, with one metal plate across the direction
/// `angle`.
fn plate(angle_rad: f64, range_m: f64) -> World {
    let (sin, cos) = elementary::sin_cos(angle_rad);
    let (centre, along) = (
        Vector2::new(cos, sin) * range_m,
        Vector2::new(-sin, cos) * 0.3,
    );
    let wall = Wall {
        from_m: centre - along,
        to_m: centre + along,
        material: Material::Metal,
    };
    let route = [[0.0, 0.0], [8.0, 0.0], [8.0, 8.0]]
        .map(Vector2::from)
        .to_vec();
    World {
        name: "plate".to_owned(),
        walls: vec![wall],
        route_m: route,
        ..World::default()
    }
}

#[test]
fn a_wall_on_the_left_is_seen_at_plus_90_degrees() {
    let robot = Robot {
        radar_mounting: Pose2::IDENTITY,
        ..Robot::default()
    };
    for degrees in [90.0_f64, -90.0, 30.0, -135.0, 177.0] {
        let angle = degrees.to_radians();
        // The robot stands for the first two seconds; the route begins a little inside its first
        // corner.
        let (start, yaw) = {
            let state = Drive::new(&plate(0.0, 5.0), robot.motion, 1).at(0);
            (Vector2::new(state.pose[0], state.pose[1]), state.pose[2])
        };
        let mut world = plate(angle + yaw, 5.0);
        for wall in &mut world.walls {
            wall.from_m += start;
            wall.to_m += start;
        }
        let mut simulation = Simulation::new(&world, robot, 1, 1);
        let scan = simulation.find_map(|event| match event {
            Event::Scan(scan) => Some(scan),
            _ => None,
        });
        let scan = scan.unwrap();
        assert!(scan.head.header.stamp_ns > START_NS);
        let strongest = scan.items.iter().filter(|item| item.range_m > 0.6);
        let strongest = strongest
            .max_by(|a, b| a.intensity.total_cmp(&b.intensity))
            .unwrap();
        let azimuth = f64::from(scan.head.sweep.beams()[usize::from(strongest.beam)].azimuth_rad);
        let error = elementary::wrap(azimuth - angle).abs().to_degrees();
        // The plate is 7 degrees wide and speckle chooses where on it is strongest.
        assert!(
            error < 4.0,
            "plate at {degrees} degrees seen at {}",
            azimuth.to_degrees()
        );
        assert!(
            (strongest.range_m - 5.0).abs() < 0.05,
            "at {} m",
            strongest.range_m
        );
    }
}

#[test]
fn each_beam_is_measured_from_its_own_pose() {
    // Put back by the truth at the beam's instant, strong near echoes stand on walls, ghosts
    // apart; put back by the pose at the sweep's end they stand elsewhere.
    let robot = Robot::default();
    let world = World::building();
    let mut drive = Drive::new(&world, robot.motion, 11);
    let (mut near, mut on_walls, mut farthest_m) = (0.0, 0.0, 0.0_f64);
    for event in Simulation::new(&world, robot, 120, 11) {
        let Event::Scan(scan) = event else { continue };
        let end = drive
            .at(scan.head.sweep.end_ns - START_NS)
            .pose2()
            .compose(&robot.radar_mounting);
        for item in scan
            .items
            .iter()
            .filter(|item| item.intensity > 30.0 && item.range_m > 0.6)
        {
            let beam = &scan.head.sweep.beams()[usize::from(item.beam)];
            let radar = drive
                .at(beam.stamp_ns - START_NS)
                .pose2()
                .compose(&robot.radar_mounting);
            let (sin, cos) = elementary::sin_cos(f64::from(beam.azimuth_rad));
            let local = Vector2::new(cos, sin) * f64::from(item.range_m);
            let point = radar.transform(local);
            farthest_m = farthest_m.max((point - end.transform(local)).norm());
            if item.range_m < 3.0 {
                let wall_m = world
                    .walls
                    .iter()
                    .map(|wall| distance(wall, point))
                    .fold(9.0, f64::min);
                near += 1.0;
                on_walls += f64::from(u8::from(wall_m < 0.15));
            }
        }
    }
    assert!(
        near > 1000.0 && on_walls / near > 0.9,
        "{on_walls} of {near} on walls"
    );
    assert!(farthest_m > 0.2, "{farthest_m} m");
}

#[test]
fn a_mirror_shows_a_ghost_behind_itself_and_a_thin_wall_what_is_behind_it() {
    let robot = Robot {
        radar_mounting: Pose2::IDENTITY,
        ..Robot::default()
    };
    let base = plate(0.0, 5.0);
    let start = Drive::new(&base, robot.motion, 1).at(0).pose2();
    // Along the beam at +90 degrees: a thin wall at 2 m, concrete at 4 m; at -90 a metal mirror at
    // 3 m that shows the wall behind the robot.
    let mut world = World {
        walls: Vec::new(),
        ..base
    };
    for (y, material) in [
        (2.0, Material::Plaster),
        (4.0, Material::Concrete),
        (-3.0, Material::Metal),
    ] {
        let [from_m, to_m] = [-1.0, 1.0].map(|x| start.transform(Vector2::new(x, y)));
        world.walls.push(Wall {
            from_m,
            to_m,
            material,
        });
    }
    let scan = Simulation::new(&world, robot, 1, 1).find_map(|event| match event {
        Event::Scan(scan) => Some(scan),
        _ => None,
    });
    let scan = scan.unwrap();
    // Strongest return near a range, in the three beams around an azimuth.
    let strongest = |azimuth_rad: f64, range_m: f32| {
        let seen = scan.items.iter().filter(|item| {
            let beam = &scan.head.sweep.beams()[usize::from(item.beam)];
            (f64::from(beam.azimuth_rad) - azimuth_rad).abs() < 0.05
                && (item.range_m - range_m).abs() < 0.05
        });
        seen.map(|item| item.intensity).fold(0.0, f32::max)
    };
    let quarter = 0.5 * elementary::PI;
    assert!(strongest(quarter, 2.0) > 20.0);
    assert!(strongest(quarter, 4.0) > 14.0, "concrete through plaster");
    assert!(strongest(-quarter, 3.0) > 25.0);
    assert!(
        strongest(-quarter, 8.0) > 12.0,
        "the plaster behind the robot, in the mirror"
    );
    assert!(strongest(-quarter, 6.3) < 12.0, "nothing is there");
}

fn distance(wall: &Wall, point: Vector2<f64>) -> f64 {
    let along = wall.to_m - wall.from_m;
    let share = ((point - wall.from_m).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (wall.from_m + along * share - point).norm()
}

#[test]
fn a_drive_for_calibration_turns_on_the_spot_to_both_sides() {
    let profile = MotionProfile::default().for_calibration();
    let mut drive = Drive::new(&World::building(), profile, 3);
    let (mut left_rad, mut right_rad, mut path_m) = (0.0, 0.0, 0.0);
    let mut last = drive.at(0);
    for index in 1..6000_i64 {
        let state = drive.at(index * 20_000_000);
        let turned_rad = state.pose[2] - last.pose[2];
        if state.velocity[0] == 0.0 && last.velocity[0] == 0.0 {
            assert_eq!(state.pose[..2], last.pose[..2], "base_link stays");
            left_rad += f64::max(turned_rad, 0.0);
            right_rad += f64::max(-turned_rad, 0.0);
        }
        path_m = state.path_m;
        last = state;
    }
    // Two minutes: some four stops with 240 degrees each way.
    assert!(
        left_rad > 10.0 && right_rad > 10.0,
        "{left_rad} {right_rad}"
    );
    assert!((left_rad - right_rad).abs() < 4.3, "{left_rad} {right_rad}");
    assert!(path_m > 20.0, "{path_m}");
}

#[test]
fn a_late_radar_sends_the_same_sweeps_later() {
    let robot = Robot {
        radar_late_ns: 30_000_000,
        ..Robot::default()
    };
    let world = World::building();
    let scans = |robot: Robot| {
        Simulation::new(&world, robot, 3, 1).filter_map(|event| match event {
            Event::Scan(scan) => Some(scan),
            _ => None,
        })
    };
    for (late, plain) in scans(robot).zip(scans(Robot::default())) {
        assert_eq!(late.items, plain.items);
        let stamps = |scan: &randt_messages::Message<randt_messages::RadarScan>| {
            let beams = scan.head.sweep.beams().iter().map(|beam| beam.stamp_ns);
            [
                scan.head.header.stamp_ns,
                scan.head.sweep.end_ns,
                scan.head.sweep.begin_ns,
            ]
            .into_iter()
            .chain(beams)
            .collect::<Vec<i64>>()
        };
        let differences = stamps(&late).into_iter().zip(stamps(&plain));
        assert!(
            differences
                .into_iter()
                .all(|(late, plain)| late - plain == 30_000_000)
        );
    }
}
