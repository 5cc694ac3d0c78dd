//! A Phidgets Spatial.
//!
//! Responsible for finding the vendor's library, for units, and for what to do when the device is
//! gone or silent. Not responsible for calling the library: `library` is.

use super::library::{Channel, Event, Library, Server};
use crate::{Error, Reading, STANDARD_GRAVITY_M_S2, reading_source::ReadingSource};
use randt_config::ImuDriver;
use randt_device::{Backoff, Count};
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

/// Its names where the system looks for libraries.
const NAMES: [&str; 2] = ["libphidget22.so.0", "libphidget22.so"];
/// How to get it.
const ADVICE: &str = "get it by `pip download Phidget22==1.26.20260821`, whose wheel has it in Phidget22/.libs, or from \
                      phidgets.com, and give its path as imu.library";
/// The library itself tries a server that is away after 2, 3, 4 ... 16 s; it is made to try after
/// this time, ns.
const RENEW_NS: i64 = 1_500_000_000;
/// The library does not notice that a server is gone without closing its connection. One that was
/// only slow needs no help, ns.
const STUCK_NS: i64 = 5_000_000_000;
/// An attached device may need this time to its first sample, ns.
const SETTLING_NS: i64 = 1_500_000_000;

/// The Spatial that the configuration names.
#[derive(Debug, Default)]
struct WantedSpatial {
    /// Path of the vendor's library; empty where the system searches.
    library: String,
    serial_number: Option<i32>,
    server: Option<Server>,
    /// USB or the server, for people.
    location: String,
    interval_ms: u32,
    patience_ns: i64,
}

/// A Phidgets Spatial.
#[derive(Debug, Default)]
pub struct Spatial {
    wanted: WantedSpatial,
    channel: Option<Channel>,
    backoff: Backoff,
    attached: bool,
    attaches: u64,
    interval_ms: u32,
    fault: String,
    complaint: String,
    /// The library's last error.
    library_error: String,
    /// Since when nothing came, and nothing was done about it.
    since_ns: i64,
}

impl Spatial {
    /// By its configuration; refuses a serial number or a server that is none.
    pub fn new(config: &ImuDriver) -> Result<Self, Error> {
        let given = |text: &String| (!text.is_empty()).then(|| text.clone());
        let server = given(&config.server).map(|text| {
            let expected = "a Phidget network server's host:port, such as \"10.0.0.5:5661\"";
            Server::parse(&text).ok_or_else(|| Error::new("server", &text, expected))
        });
        let serial_number = given(&config.device).map(|text| {
            let number = text.parse::<i32>().ok().filter(|number| *number > 0);
            let expected = "a Phidget's serial number, or empty";
            number.ok_or_else(|| Error::new("device", &text, expected))
        });
        let location = match given(&config.server) {
            Some(server) => format!("at {server}"),
            None => "on USB".to_owned(),
        };
        Ok(Self {
            wanted: WantedSpatial {
                library: config.library.clone(),
                serial_number: serial_number.transpose()?,
                server: server.transpose()?,
                location,
                interval_ms: ((1000.0 / config.rate_hz + 0.5) as u32).max(1),
                patience_ns: ((config.silence_s * 1e9) as i64).max(SETTLING_NS),
            },
            ..Self::default()
        })
    }

    fn open(&mut self, now_ns: i64) {
        let wanted = &self.wanted;
        let (serial_number, interval_ms) = (wanted.serial_number, wanted.interval_ms);
        let opened = self.load().and_then(|library| {
            Channel::open(library, serial_number, wanted.server.clone(), interval_ms)
        });
        match opened {
            Ok(channel) => {
                self.channel = Some(channel);
                self.fault.clear();
                self.since_ns = now_ns;
            }
            Err(why) => {
                self.fault = why;
                self.backoff.failed(now_ns);
            }
        }
    }

    fn load(&self) -> Result<Library, String> {
        let names: &[&str] = match self.wanted.library.as_str() {
            "" => &NAMES,
            configured => &[configured],
        };
        let mut why = String::new();
        for name in names {
            match Library::load(name) {
                Ok(library) => return Ok(library),
                Err(error) => why = error.to_string(),
            }
        }
        // The loader names what it did not find: the library itself, or one that it needs.
        Err(match why.contains("libusb") {
            true => format!("libphidget22 needs libusb-1.0 (apt install libusb-1.0-0): {why}"),
            false => format!("libphidget22 is not installed: {ADVICE} ({why})"),
        })
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
                self.fault.clear();
                self.library_error.clear();
                self.since_ns = now_ns;
            }
            Event::Detach => {
                self.attached = false;
                let location = &self.wanted.location;
                self.fault = format!("the Phidget {location} is gone; waiting for it");
                self.since_ns = now_ns;
            }
            Event::Error(text) => self.library_error = text,
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

    /// What is done about a device that does not come, or does not send. The library itself
    /// notices what is plugged in on USB.
    fn insist(&mut self, now_ns: i64) {
        if now_ns < self.insist_ns() {
            return;
        }
        self.since_ns = now_ns;
        if !self.attached {
            let location = &self.wanted.location;
            self.fault = format!("no Phidget Spatial {location}; waiting for one");
            if !self.library_error.is_empty() {
                self.fault += &format!(" ({})", self.library_error);
            }
        }
        if let Some(channel) = &self.channel
            && (self.attached || self.wanted.server.is_some())
        {
            channel.renew();
        }
    }

    fn insist_ns(&self) -> i64 {
        let pause_ns = match (self.attached, &self.wanted.server) {
            (false, _) => RENEW_NS,
            (true, Some(_)) => self.wanted.patience_ns.max(STUCK_NS),
            (true, None) => self.wanted.patience_ns,
        };
        self.since_ns.saturating_add(pause_ns)
    }
}

impl ReadingSource for Spatial {
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

    fn fault(&self) -> &str {
        &self.fault
    }

    fn silence(&self) -> String {
        if self.attached {
            format!("the Phidget {} sends no sample", self.wanted.location)
        } else {
            format!("no Phidget Spatial {}", self.wanted.location)
        }
    }

    fn complaint(&self) -> &str {
        &self.complaint
    }

    fn interval_ns(&self) -> i64 {
        let interval_ms = match self.interval_ms {
            0 => self.wanted.interval_ms,
            agreed => agreed,
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
    fn a_missing_library_is_reported_with_how_to_get_it() {
        let config = config(|imu| imu.library = "/nowhere/libphidget22.so".to_owned());
        let mut spatial = Spatial::new(&config).unwrap();
        spatial.poll(&|| 0, &mut Vec::new());
        let text = spatial.fault();
        assert!(
            text.starts_with("libphidget22 is not installed: get it by `pip"),
            "{text}"
        );
        assert!(text.contains("/nowhere/libphidget22.so"), "{text}");
        assert_eq!(spatial.due_ns(), Some(100_000_000));
    }

    #[test]
    fn what_is_no_library_is_reported() {
        let config = config(|imu| imu.library = "libc.so.6".to_owned());
        let mut spatial = Spatial::new(&config).unwrap();
        spatial.poll(&|| 0, &mut Vec::new());
        let text = spatial.fault();
        assert!(text.contains("PhidgetSpatial_create"), "{text}");
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
            let text = Spatial::new(&set).unwrap_err().to_string();
            assert!(text.starts_with(key), "{text}");
        }
    }
}
