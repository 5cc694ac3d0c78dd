//! A Phidgets Spatial.
//!
//! Responsible for finding the vendor's library, for units, and for what to do when the device is gone or silent. Not
//! responsible for calling the library: `library` is.

use super::library::{Channel, Event, Library, Server};
use crate::{Error, Reading, STANDARD_GRAVITY_M_S2, source::Source};
use randt_config::ImuDriver;
use randt_device::{Backoff, Count};
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

/// Its names where the system looks for libraries.
const NAMES: [&str; 2] = ["libphidget22.so.0", "libphidget22.so"];
/// How to get it.
const ADVICE: &str = "get it by `pip download Phidget22==1.26.20260821`, whose wheel has it in Phidget22/.libs, or from \
                      phidgets.com, and give its path as imu.library";
/// The library itself tries a server that is away after 2, 3, 4 ... 16 s; it is made to try after this time, ns.
const RENEW_NS: i64 = 1_500_000_000;
/// The library does not notice that a server is gone without a word. One that was only slow needs no help, ns.
const STUCK_NS: i64 = 5_000_000_000;
/// An attached device may need so long to its first sample, ns.
const SETTLING_NS: i64 = 1_500_000_000;

/// A Phidgets Spatial.
#[derive(Debug)]
pub struct Spatial {
    library: String,
    serial_number: Option<i32>,
    server: Option<Server>,
    /// Where it is, for people.
    place: String,
    asked_ms: u32,
    patience_ns: i64,
    channel: Option<Channel>,
    backoff: Backoff,
    attached: bool,
    attaches: u64,
    interval_ms: u32,
    trouble: String,
    complaint: String,
    /// The library's last word.
    said: String,
    /// Since when nothing came, and nothing was done about it.
    since_ns: i64,
}

impl Spatial {
    /// By its configuration; refuses a serial number or a server that is none.
    pub fn new(config: &ImuDriver) -> Result<Self, Error> {
        let given = |text: &String| (!text.is_empty()).then(|| text.clone());
        let refused = |key, found, expected| Error::Value {
            key,
            found,
            expected,
        };
        let server = given(&config.server).map(|text| {
            let expected = "a Phidget network server's host:port, such as \"10.0.0.5:5661\"";
            Server::of(&text).ok_or_else(|| refused("server", text, expected))
        });
        let serial_number = given(&config.device).map(|text| {
            let number = text.parse::<i32>().ok().filter(|number| *number > 0);
            number.ok_or_else(|| refused("device", text, "a Phidget's serial number, or empty"))
        });
        let place = match given(&config.server) {
            Some(server) => format!("at {server}"),
            None => "on USB".to_owned(),
        };
        Ok(Self {
            library: config.library.clone(),
            serial_number: serial_number.transpose()?,
            server: server.transpose()?,
            place,
            asked_ms: ((1000.0 / config.rate_hz + 0.5) as u32).max(1),
            patience_ns: ((config.silence_s * 1e9) as i64).max(SETTLING_NS),
            channel: None,
            backoff: Backoff::default(),
            attached: false,
            attaches: 0,
            interval_ms: 0,
            trouble: String::new(),
            complaint: String::new(),
            said: String::new(),
            since_ns: 0,
        })
    }

    fn open(&mut self, now_ns: i64) {
        let opened = self.load().and_then(|library| {
            Channel::open(
                library,
                self.serial_number,
                self.server.clone(),
                self.asked_ms,
            )
        });
        match opened {
            Ok(channel) => {
                self.channel = Some(channel);
                self.trouble.clear();
                self.since_ns = now_ns;
            }
            Err(why) => {
                self.trouble = why;
                self.backoff.failed(now_ns);
            }
        }
    }

    fn load(&self) -> Result<Library, String> {
        let configured = [self.library.as_str()];
        let names: &[&str] = if self.library.is_empty() {
            &NAMES
        } else {
            &configured
        };
        let mut why = String::new();
        for name in names {
            match Library::load(name) {
                Ok(library) => return Ok(library),
                Err(error) => why = error.to_string(),
            }
        }
        // The loader names what it did not find: the library itself, or one that it needs.
        if why.contains("libusb") {
            return Err(format!(
                "libphidget22 needs libusb-1.0 (apt install libusb-1.0-0): {why}"
            ));
        }
        Err(format!("libphidget22 is not installed: {ADVICE} ({why})"))
    }

    fn take(&mut self, event: Event, now_ns: i64, now: Instant, readings: &mut Vec<Reading>) {
        match event {
            Event::Attach {
                interval_ms,
                complaint,
            } => {
                self.attached = true;
                self.attaches += 1;
                self.interval_ms = interval_ms;
                self.complaint = complaint;
                self.trouble.clear();
                self.said.clear();
                self.since_ns = now_ns;
            }
            Event::Detach => {
                self.attached = false;
                self.trouble = format!("the Phidget {} is gone; waiting for it", self.place);
                self.since_ns = now_ns;
            }
            Event::Error(text) => self.said = text,
            Event::Data {
                at,
                acceleration_g,
                rate_deg_s,
                timestamp_ms,
            } => {
                let nanos = |time: Duration| i64::try_from(time.as_nanos()).unwrap_or(0);
                let before_ns = nanos(now.saturating_duration_since(at));
                let after_ns = nanos(at.saturating_duration_since(now));
                let arrival_ns = now_ns.saturating_sub(before_ns).saturating_add(after_ns);
                readings.push(Reading {
                    device_ns: (timestamp_ms.abs() < 1e12).then_some((timestamp_ms * 1e6) as i64),
                    counter: None,
                    arrival_ns,
                    rate_rad_s: rate_deg_s.map(f64::to_radians),
                    acceleration_m_s2: acceleration_g.map(|value| value * STANDARD_GRAVITY_M_S2),
                });
                self.since_ns = now_ns;
            }
        }
    }

    /// What is done about a device that does not come, or does not send. The library sees by itself what is plugged in
    /// on USB.
    fn insist(&mut self, now_ns: i64) {
        if now_ns < self.insist_ns() {
            return;
        }
        self.since_ns = now_ns;
        if !self.attached {
            self.trouble = format!("no Phidget Spatial {}; waiting for one", self.place);
            if !self.said.is_empty() {
                self.trouble = format!("{} ({})", self.trouble, self.said);
            }
        }
        if let Some(channel) = &self.channel
            && (self.attached || self.server.is_some())
        {
            channel.renew();
        }
    }

    fn insist_ns(&self) -> i64 {
        let pause_ns = match (self.attached, &self.server) {
            (false, _) => RENEW_NS,
            (true, Some(_)) => self.patience_ns.max(STUCK_NS),
            (true, None) => self.patience_ns,
        };
        self.since_ns.saturating_add(pause_ns)
    }
}

impl Source for Spatial {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.channel.as_ref().map(Channel::descriptor)
    }

    fn poll(&mut self, clock: &dyn Fn() -> i64, readings: &mut Vec<Reading>) {
        let now = Instant::now();
        let now_ns = clock();
        if self.channel.is_none() && self.backoff.is_due(now_ns) {
            self.open(now_ns);
        }
        let Some(channel) = self.channel.take() else {
            return;
        };
        for event in channel.events() {
            self.take(event, now_ns, now, readings);
        }
        self.channel = Some(channel);
        self.insist(now_ns);
    }

    fn due_ns(&self) -> Option<i64> {
        let due_ns = match self.channel {
            Some(_) => self.insist_ns(),
            None => self.backoff.due_ns(),
        };
        Some(due_ns)
    }

    fn trouble(&self) -> &str {
        &self.trouble
    }

    fn silence(&self) -> String {
        if self.attached {
            format!("the Phidget {} sends no sample", self.place)
        } else {
            format!("no Phidget Spatial {}", self.place)
        }
    }

    fn complaint(&self) -> &str {
        &self.complaint
    }

    fn interval_ns(&self) -> i64 {
        let interval_ms = if self.interval_ms > 0 {
            self.interval_ms
        } else {
            self.asked_ms
        };
        i64::from(interval_ms) * 1_000_000
    }

    fn reconnects(&self) -> u64 {
        self.attaches.saturating_sub(1)
    }

    fn counts(&self) -> Vec<Count> {
        let lost = self.channel.as_ref().map_or(0, Channel::lost);
        vec![Count::loss("overruns", lost)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(set: impl Fn(&mut ImuDriver)) -> ImuDriver {
        let mut config = ImuDriver::default();
        set(&mut config);
        config
    }

    #[test]
    fn a_missing_library_is_said_and_how_to_get_it() {
        let config = config(|imu| imu.library = "/nowhere/libphidget22.so".to_owned());
        let mut spatial = Spatial::new(&config).unwrap();
        spatial.poll(&|| 0, &mut Vec::new());
        let told = spatial.trouble();
        assert!(
            told.starts_with("libphidget22 is not installed: get it by `pip"),
            "{told}"
        );
        assert!(told.contains("/nowhere/libphidget22.so"), "{told}");
        assert_eq!(spatial.due_ns(), Some(100_000_000));
    }

    #[test]
    fn what_is_no_library_is_said() {
        let config = config(|imu| imu.library = "libc.so.6".to_owned());
        let mut spatial = Spatial::new(&config).unwrap();
        spatial.poll(&|| 0, &mut Vec::new());
        let told = spatial.trouble();
        assert!(told.contains("PhidgetSpatial_create"), "{told}");
    }

    #[test]
    fn a_serial_number_or_server_that_is_none_is_refused() {
        for (set, key) in [
            (
                config(|imu| imu.device = "/dev/ttyUSB0".to_owned()),
                "imu.device",
            ),
            (config(|imu| imu.server = "robot".to_owned()), "imu.server"),
            (config(|imu| imu.server = ":5661".to_owned()), "imu.server"),
        ] {
            let told = Spatial::new(&set).unwrap_err().to_string();
            assert!(told.starts_with(key), "{told}");
        }
    }
}
