//! One message of every topic, with another value in each field.

use randt_messages::health::fixed_text;
use randt_messages::{
    Beam, Correction, DropCause, GraphEntry, GraphEntryKind, GraphHead, Header, ImuSample,
    ImuSampleTopic, ImuUse, Keyframe, KeyframeBeam, KeyframeHead, KeyframePoint, Localizability,
    LogDrop, LogDropTopic, MapperCorrection, MapperGraph, MapperGrid, Message, OdometryState,
    OdometryStateTopic, PointsHead, PortHealth, RadarPoints, RadarScan, Return, ScanHead,
    SensorKind, StageHealth, StageHealthTopic, StageState, SweepHead, TILE_CELLS, TileHead, Topic,
    Trust, TruthPose, TruthPoseTopic, Twist, TwistTopic,
};

/// A header with another value in each field of each message.
pub fn header(number: u64) -> Header {
    Header {
        sequence: number + 10,
        stamp_ns: 1_700_000_000_000_000_000 + number as i64,
        epoch: number + 20,
        published_ns: 1_700_000_000_000_000_500 + number as i64,
    }
}

pub fn message<T: Topic>(head: T::Head, items: Vec<T::Item>) -> Message<T> {
    let mut message = Message::default();
    *message.head = head;
    message.items = items;
    message
}

pub fn sweep(contested: u64) -> SweepHead {
    let mut sweep = SweepHead {
        begin_ns: 1_699_999_999_800_000_000,
        end_ns: 1_700_000_000_000_000_000,
        sensor: SensorKind::NavtechCts as u32,
        beam_count: 3,
        beams_lost: 4,
        returns_dropped: 5,
        range_resolution_m: 0.125,
        azimuth_step_rad: 0.0625,
        contested,
        ..SweepHead::default()
    };
    for (beam, number) in sweep.beams.iter_mut().zip(0..3) {
        *beam = Beam {
            stamp_ns: 1_699_999_999_900_000_000 + i64::from(number),
            azimuth_rad: -0.5 * number as f32,
            first_return: 2 * number,
        };
    }
    sweep
}

pub fn returns() -> Vec<Return> {
    let numbers = (0..6_u16).map(|number| Return {
        range_m: 1.5 + f32::from(number),
        intensity: 40.25 - f32::from(number),
        beam: number / 2,
        bin: 100 + number,
    });
    numbers.collect()
}

pub fn scan() -> Message<RadarScan> {
    let head = ScanHead {
        header: header(1),
        sweep: sweep(1),
    };
    message(head, returns())
}

pub fn points() -> Message<RadarPoints> {
    let head = PointsHead {
        header: header(2),
        scan_sequence: 31,
        scan_epoch: 32,
        scan_published_ns: 33,
        sweep: sweep(0),
    };
    message(head, returns())
}

pub fn sample() -> Message<ImuSampleTopic> {
    let head = ImuSample {
        header: header(3),
        device_ns: -41,
        arrival_ns: 42,
        rate_rad_s: [0.1, -0.2, 0.3],
        acceleration_m_s2: [0.4, 0.5, 9.81],
    };
    message(head, Vec::new())
}

pub fn twist() -> Message<TwistTopic> {
    let head = Twist {
        header: header(12),
        arrival_ns: 43,
        velocity: [0.75, -0.03125, 0.25],
        covariance: [1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5, 9.5],
    };
    message(head, Vec::new())
}

pub fn state() -> Message<OdometryStateTopic> {
    let head = OdometryState {
        header: header(4),
        id: 51,
        scan_sequence: 52,
        scan_epoch: 53,
        odom_frame_id: 54,
        pose: [1.0, 2.0, 0.5],
        retired_stamp_ns: 55,
        retired_pose: [0.75, 1.75, 0.25],
        velocity: [1.25, -0.125, 0.0625],
        gyro_bias_rad_s: [0.001, 0.002, 0.003],
        attitude: [0.5, 0.5, -0.5, 0.5],
        covariance: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        information_eigenvalues: [905.0, 1e6],
        weak_direction_rad: -1.25,
        fit: 0.625,
        cost: 17.5,
        imu_sequence: 56,
        imu_epoch: 57,
        scan_published_ns: 58,
        imu_published_ns: 59,
        imu_use: ImuUse::Late as u32,
        trust: Trust::Degraded as u32,
        trust_reasons: 65,
        localizability: Localizability::Partial as u32,
        points: 60,
        cells: 61,
        inliers: 62,
        iterations: 63,
        submap_id: 64,
    };
    message(head, Vec::new())
}

pub fn keyframe() -> Message<Keyframe> {
    let mut head = KeyframeHead {
        header: header(5),
        id: 71,
        odom_frame_id: 72,
        submap_id: 73,
        submap_root: 74,
        scan_sequence: 75,
        pose: [-1.0, 0.5, 3.0],
        covariance: [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0],
        twist: [0.5, 0.25, 0.125],
        weak_direction_rad: 0.75,
        trust: Trust::Good as u32,
        trust_reasons: 76,
        localizability: Localizability::None as u32,
        beam_count: 2,
        ..KeyframeHead::default()
    };
    for (beam, number) in head.beams.iter_mut().zip(0..2_u8) {
        *beam = KeyframeBeam {
            x_m: 0.25 * f32::from(number),
            y_m: -0.5,
            azimuth_rad: 1.5,
            first_point: 2 * u32::from(number),
        };
    }
    let points = (0..4_u16).map(|number| KeyframePoint {
        x_m: f32::from(number),
        y_m: -2.5,
        intensity: 12.5,
        beam: number / 2,
        reserved: 0,
    });
    message(head, points.collect())
}

pub fn correction() -> Message<MapperCorrection> {
    let head = Correction {
        header: header(6),
        graph_version: 81,
        odom_frame_id: 82,
        component: 83,
        map_from_odom: [4.0, -5.0, 0.75],
    };
    message(head, Vec::new())
}

pub fn graph() -> Message<MapperGraph> {
    let head = GraphHead {
        header: header(7),
        graph_version: 91,
        keyframes: 92,
        wanted_keyframe: 93,
        on_disk: 94,
        odom_frame_id: 95,
        loops: 96,
        confirmed_loops: 103,
        components: 97,
        path_m: 98.5,
        tiles: 99,
        first_entry: 100,
        send_again: 1,
    };
    let entries = [GraphEntryKind::Node, GraphEntryKind::Loop].map(|kind| GraphEntry {
        a: 101,
        b: 102,
        stamp_ns: 103,
        pose: [6.0, 7.0, -0.25],
        weight: 0.5,
        kind: kind as u32,
    });
    message(head, entries.into())
}

pub fn tile() -> Message<MapperGrid> {
    let head = TileHead {
        header: header(8),
        grid_version: 111,
        column: -3,
        row: 4,
        resolution_m: 0.05,
    };
    let cells = (0..TILE_CELLS * TILE_CELLS).map(|cell| [0, 100, 255][cell / 7 % 3]);
    message(head, cells.collect())
}

pub fn health() -> Message<StageHealthTopic> {
    let mut head = StageHealth {
        header: header(9),
        name: fixed_text("odometry"),
        message: fixed_text("no IMU"),
        pid: 121,
        started_ns: 122,
        restarts: 123,
        lost: 124,
        state: StageState::Degraded as u32,
        port_count: 1,
        ..StageHealth::default()
    };
    head.ports[0] = PortHealth {
        topic: fixed_text("radar/points/v1"),
        messages: 125,
        lost: 126,
        last_published_ns: 127,
        publishes: 1,
    };
    message(head, Vec::new())
}

pub fn truth() -> Message<TruthPoseTopic> {
    let head = TruthPose {
        header: header(10),
        pose: [8.0, 9.0, -3.0],
        velocity: [0.25, 0.5, 0.75],
    };
    message(head, Vec::new())
}

pub fn missing() -> Message<LogDropTopic> {
    let head = LogDrop {
        header: header(11),
        begin_ns: 131,
        end_ns: 132,
        count: 133,
        topic: fixed_text("imu/sample/v1"),
        cause: DropCause::Full as u32,
        reserved: 0,
    };
    message(head, Vec::new())
}
