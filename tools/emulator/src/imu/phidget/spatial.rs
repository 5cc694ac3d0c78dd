//! The device: a PhidgetSpatial Precision 3/3/3, and the messages of its channel.
//!
//! Texts are written out: the library takes their keys in this order only.

use crate::imu::ImuMeasurement;
use randt_imu::STANDARD_GRAVITY_M_S2;
use std::fmt::Write;

/// The library's number of the device in this connection; any will do.
const PHID: u32 = 10_001;
/// PhidgetSpatial's class.
const CLASS: u64 = 26;
/// Interval after each opening, ms: the library's default.
const INTERVAL_MS: u32 = 250;
/// The library's value for what is not known.
const UNKNOWN: f64 = 1e300;
/// Command to a channel: set the interval.
const SET_INTERVAL: u64 = 54;
/// Messages of a channel: its state, and a measurement.
const STATUS: u32 = 0;
const DATA: u32 = 89;

/// The announcement of the device.
pub(super) fn device(serial_number: u32) -> String {
    format!(
        r#"{{"type":"USB","phid":{PHID},"parent":0,"vendorID":1730,"productID":140,"interfaceNum":0,"version":110,"serialNumber":{serial_number},"label":"","index":0,"deviceID":140,"vintID":0,"hubPort":0,"isHubPort":0,"name":"PhidgetSpatial Precision 3/3/3","desc":"PhidgetSpatial Precision 3/3/3","fwstr":"110"}}"#
    )
}

/// An open channel of the device.
#[derive(Debug)]
pub(super) struct Channel {
    id: u64,
    /// The library's number of this kind of channel.
    index: u64,
    interval_ms: u32,
    /// The device's time when it was attached.
    attached_ns: Option<i64>,
}

impl Channel {
    /// As a client opens it.
    pub(super) fn open(serial_number: u32, index: u64) -> Self {
        Self {
            id: u64::from(serial_number) | CLASS << 40 | (index & 0xFF) << 56,
            index,
            interval_ms: INTERVAL_MS,
            attached_ns: None,
        }
    }

    /// Carries out a client's command.
    pub(super) fn configure(&mut self, text: &serde_json::Value) {
        let command = text.get("p").and_then(serde_json::Value::as_u64);
        let interval = text.pointer("/e/0/v").and_then(serde_json::Value::as_u64);
        if let (Some(SET_INTERVAL), Some(interval_ms)) = (command, interval) {
            self.interval_ms = u32::try_from(interval_ms).unwrap_or(INTERVAL_MS).max(1);
        }
    }

    /// From one measurement to the next, ns.
    pub(super) fn interval_ns(&self) -> i64 {
        i64::from(self.interval_ms) * 1_000_000
    }

    /// Its state.
    pub(super) fn status(&self) -> String {
        let interval = self.interval_ms;
        let entries = [
            ("_class_version_", "u", "7".to_owned()),
            ("minAcceleration", "G", vector([-8.0; 3])),
            ("maxAcceleration", "G", vector([8.0; 3])),
            ("algorithm", "d", "0".to_owned()),
            ("algorithmMagnetometerGain", "g", "0.005".to_owned()),
            ("minAngularRate", "G", vector([-2000.0; 3])),
            ("maxAngularRate", "G", vector([2000.0; 3])),
            ("dataInterval", "u", interval.to_string()),
            ("minDataInterval", "u", "4".to_owned()),
            ("maxDataInterval", "u", "1000".to_owned()),
            ("dataIntervalDbl", "g", format!("{interval}.0")),
            ("minDataRate", "g", "1.0".to_owned()),
            ("maxDataRate", "g", "250.0".to_owned()),
            ("heatingEnabled", "d", "0".to_owned()),
            ("minMagneticField", "G", vector([-8.0; 3])),
            ("maxMagneticField", "G", vector([8.0; 3])),
            ("precision", "d", "3".to_owned()),
        ];
        self.bridge(STATUS, &entries)
    }

    /// A measurement.
    pub(super) fn data(&mut self, measurement: &ImuMeasurement) -> String {
        let attached_ns = *self.attached_ns.get_or_insert(measurement.device_ns);
        if measurement.device_ns < attached_ns {
            self.attached_ns = Some(measurement.device_ns);
        }
        let since_ns = measurement.device_ns - attached_ns.min(measurement.device_ns);
        let acceleration_g = measurement
            .acceleration_m_s2
            .map(|value| value / STANDARD_GRAVITY_M_S2);
        let entries = [
            ("0", "G", vector(acceleration_g)),
            (
                "1",
                "G",
                vector(measurement.rate_rad_s.map(f64::to_degrees)),
            ),
            ("2", "G", vector([UNKNOWN; 3])),
            ("3", "g", format!("{:.6}", since_ns as f64 * 1e-6)),
        ];
        self.bridge(DATA, &entries)
    }

    fn bridge(&self, packet: u32, entries: &[(&str, &str, String)]) -> String {
        let Self { id, index, .. } = self;
        let count = entries.len();
        let mut text = format!(
            r#"{{"v":0,"s":2,"f":0,"p":{packet},"I":{PHID},"O":{id},"X":{index},"c":{count},"e":{{"#
        );
        for (i, (name, kind, value)) in entries.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // A text takes all that is written to it.
            let _ = write!(text, r#"{comma}"{name}":{{"t":"{kind}","v":{value}}}"#);
        }
        text.push_str("}}");
        text
    }
}

fn vector(values: [f64; 3]) -> String {
    // With all their digits, and never as an integer.
    format!("[{:?},{:?},{:?}]", values[0], values[1], values[2])
}
