//! The example that sends the pose to a flight controller, read by pymavlink's own decoder.

use super::{examples, printed};
use crate::support::pipeline::Pipeline;
use crate::support::{ended, python};
use randt_messages::{Message, OdometryState, OdometryStateTopic, Trust};
use serde_json::Value;
use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::net::UdpSocket;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Longest that the example may take for two states that wait for it.
const TIME_MAX: Duration = Duration::from_secs(30);

/// Heading to the left of `odom`'s x, rolled to the right by 10 degrees.
fn state(id: u64, odom_frame_id: u64, trust: Trust) -> OdometryState {
    let mut state = OdometryState {
        id,
        odom_frame_id,
        pose: [3.0, 4.0, FRAC_PI_2],
        velocity: [2.0, 0.5, 0.3],
        // Cosine and sine of 5 degrees.
        attitude: [0.996_194_698, 0.087_155_743, 0.0, 0.0],
        covariance: [0.01, 0.002, 0.0005, 0.002, 0.04, 0.0, 0.0005, 0.0, 0.001],
        trust: trust as u32,
        ..OdometryState::default()
    };
    state.header.stamp_ns = 1_700_000_000_123_456_789;
    state
}

/// The messages in datagrams, each in hexadecimal.
fn decoded(datagrams: [String; 2]) -> [Value; 2] {
    let mut read = python::script("read_mavlink.py").unwrap();
    read.args(datagrams);
    let ended = ended(read);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let lines = ended.stdout.lines();
    let messages: Vec<Value> = lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    messages.try_into().unwrap()
}

fn assert_near(found: &Value, expected: &[f64]) {
    let found: Vec<f64> = match found {
        Value::Array(values) => values.iter().map(|value| value.as_f64().unwrap()).collect(),
        value => vec![value.as_f64().unwrap()],
    };
    assert_eq!(found.len(), expected.len());
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4, "{found:?}, {expected:?}");
}

#[test]
fn a_flight_controller_gets_the_pose_forward_right_and_down() {
    let Some(mut send) = python::program(&examples().join("send_mavlink.py")) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("randt_bus.py"), printed("--python")).unwrap();
    let pipeline = Pipeline::new("mavlink");
    let mut odometry = randt_stage::Stage::open("odometry", pipeline.domain()).unwrap();
    let mut states = odometry.publisher::<OdometryStateTopic>().unwrap();
    odometry.running().unwrap();
    for state in [state(0, 7, Trust::Good), state(1, 8, Trust::Lost)] {
        let mut message = Message::<OdometryStateTopic>::default();
        *message.head = state;
        states.publish(message.as_ref()).unwrap();
    }

    let controller = UdpSocket::bind("127.0.0.1:0").unwrap();
    controller.set_read_timeout(Some(TIME_MAX)).unwrap();
    let address = format!("udpout:{}", controller.local_addr().unwrap());
    pipeline.enter(&mut send);
    send.args(["--scans", "2", "--to", &address]);
    send.env("PYTHONPATH", folder.path()).stderr(Stdio::piped());
    let mut send = send.spawn().unwrap();
    // The history is delivered while this process waits.
    let begin = Instant::now();
    while send.try_wait().unwrap().is_none() && begin.elapsed() < TIME_MAX {
        odometry.wait(&[], Some(Duration::from_millis(50))).unwrap();
    }
    let _ = send.kill();
    let output = send.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let received = [(); 2].map(|()| {
        let mut datagram = [0; 512];
        let length = controller.recv(&mut datagram).unwrap();
        let bytes = datagram[..length].iter();
        bytes.map(|byte| format!("{byte:02x}")).collect()
    });
    let [first, second] = decoded(received);

    assert_eq!(first["mavpackettype"], "ODOMETRY");
    assert_eq!(first["time_usec"], 1_700_000_000_123_456_i64);
    let frames = ["MAV_FRAME_LOCAL_FRD", "MAV_FRAME_BODY_FRD"];
    assert_eq!(first["frames"], serde_json::json!(frames));
    assert_near(&first["x"], &[3.0]);
    assert_near(&first["y"], &[-4.0]);
    assert_near(&first["euler_deg"], &[10.0, 0.0, -90.0]);
    assert_near(&first["vx"], &[2.0]);
    assert_near(&first["vy"], &[-0.5]);
    assert_near(&first["yawspeed"], &[-0.3]);
    // In the frame of the pose x is what was to the robot's right, and y what was behind it.
    let covariance = first["pose_covariance"].as_array().unwrap();
    let of = |indices: [usize; 6]| -> Value {
        let picked = indices.map(|index| covariance[index].clone());
        picked.to_vec().into()
    };
    // xx, xy, x yaw, yy, y yaw, yaw yaw in the upper triangle of six rows.
    assert_near(
        &of([0, 1, 5, 6, 10, 20]),
        &[0.04, 0.002, 0.0, 0.01, 0.0005, 0.001],
    );
    assert_eq!(first["velocity_covariance"], Value::Null);
    assert_eq!(
        (&first["quality"], &first["reset_counter"]),
        (&100.into(), &0.into())
    );

    assert_eq!(
        (&second["quality"], &second["reset_counter"]),
        (&(-1).into(), &1.into())
    );
}
