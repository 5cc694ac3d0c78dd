//! Sensors that are not there, as processes, and the robot file that leads to them.

use super::randt;
use std::fs::{self, File};
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{SystemTime, UNIX_EPOCH};

/// Both protocols of a robot, with places of its own to reach the sensors at.
pub struct Sensors {
    folder: PathBuf,
    radar: &'static str,
    imu: &'static str,
    port: u16,
}

/// An emulator that runs; it goes with this.
pub struct Emulator(Child);

impl Sensors {
    /// `radar`: beam-udp or navtech; `imu`: mip, xsens or line.
    pub fn new(folder: &Path, radar: &'static str, imu: &'static str) -> Self {
        // Free at this moment: the kernel gives out another one each time.
        let any = "127.0.0.1:0";
        let address = match radar {
            "navtech" => TcpListener::bind(any).and_then(|socket| socket.local_addr()),
            _ => UdpSocket::bind(any).and_then(|socket| socket.local_addr()),
        };
        Self {
            folder: folder.to_owned(),
            radar,
            imu,
            port: address.unwrap().port(),
        }
    }

    /// Where the radar is, or is listened to.
    pub fn address(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    /// The serial port.
    pub fn device(&self) -> PathBuf {
        self.folder.join("imu")
    }

    /// The robot's file: the simulator's mounting, and these addresses.
    pub fn robot(&self) -> PathBuf {
        let path = self.folder.join("robot.toml");
        let (radar, imu) = (self.radar, self.imu);
        let (address, device) = (self.address(), self.device());
        let text = format!(
            "[robot]\nradar_x_m = 0.12\n[radar]\nsource = \"{radar}\"\naddress = \"{address}\"\n\
             [imu]\nsource = \"{imu}\"\ndevice = \"{}\"\n",
            device.display()
        );
        fs::write(&path, text).unwrap();
        path
    }

    /// Starts the radar of a log. `more`: further arguments.
    pub fn radar(&self, log: &Path, more: &[&str]) -> Emulator {
        self.emulate(
            "radar",
            self.radar,
            "--address",
            self.address().as_ref(),
            log,
            more,
        )
    }

    /// Starts the IMU of a log.
    pub fn imu(&self, log: &Path, more: &[&str]) -> Emulator {
        self.emulate("imu", self.imu, "--link", self.device().as_ref(), log, more)
    }

    fn emulate(
        &self,
        sensor: &str,
        protocol: &str,
        place: &str,
        at: &std::ffi::OsStr,
        log: &Path,
        more: &[&str],
    ) -> Emulator {
        let mut command = randt(&["emulate", sensor, "--proto", protocol, "--log"]);
        command.arg(log).arg(place).arg(at).args(more);
        command.args(["--parent", &std::process::id().to_string()]);
        let errors = self.folder.join(format!("{sensor}.errors"));
        command.stdin(Stdio::null()).stdout(Stdio::null());
        command.stderr(File::create(errors).unwrap());
        Emulator(command.spawn().unwrap())
    }
}

impl Emulator {
    /// Whether it has played its log to the end.
    pub fn ended(&mut self) -> bool {
        match self.0.try_wait().unwrap() {
            Some(status) => {
                assert!(status.success(), "an emulator ended with {status}");
                true
            }
            None => false,
        }
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The system's time, s.
pub fn unix_s() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap()
        .as_secs_f64()
}
