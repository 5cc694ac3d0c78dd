//! A robot on a booted machine: its configuration, its emulated sensors, and waiting for what
//! becomes of them.

use super::boot::{Image, Machine};
use super::pipeline::log;
use std::path::Path;
use std::time::{Duration, Instant};

/// Where the drive is on the machine.
const DRIVE: &str = "/usr/bin/drive.mcap";
/// A radar that sends, and an IMU on a terminal.
pub const ROBOT: &str = "[robot]\nradar_x_m = 0.12\n[radar]\nsource = \"beam-udp\"\naddress = \"127.0.0.1:6320\"\n\
     [imu]\nsource = \"mip\"\ndevice = \"/run/randt/imu\"\n[record]\nfree_min_gb = 0.1\n";

/// How long a machine's state is waited for: seconds where nothing else runs.
pub const BOOTED_MAX: Duration = Duration::from_secs(120);

/// Whether a machine can be booted here. Under CI it must.
pub fn can_boot() -> bool {
    let is_there = |path: &str| Path::new(path).exists();
    let missing = if !rustix::process::geteuid().is_root() {
        "root"
    } else if !is_there("/lib/systemd/systemd") {
        "systemd"
    } else if !is_there("/usr/bin/dpkg-deb") {
        "dpkg"
    } else if !is_there("/usr/sbin/mkfs.ext4") && !is_there("/sbin/mkfs.ext4") {
        "e2fsprogs"
    } else {
        return true;
    };
    let is_ci = std::env::var("CI").as_deref() == Ok("true");
    assert!(!is_ci, "needs {missing}");
    println!("not tested: it needs {missing}");
    false
}

/// Lays a simulated drive and what the emulated IMU needs on a machine that is going to be booted.
pub fn equip(image: &Image, folder: &Path, scans: u32) {
    image.program(&log(folder, scans), "drive.mcap");
    // The emulated IMU's terminal.
    let terminal = "[Service]\nDeviceAllow=char-pts rw\n";
    image.write("etc/systemd/system/randt-imu.service.d/test.conf", terminal);
}

/// Starts both sensors, as if they were switched on at this moment.
pub fn emulate(machine: &Machine) {
    let at = super::sensors::unix_s().to_string();
    let radar = [
        "radar",
        "--proto",
        "beam-udp",
        "--address",
        "127.0.0.1:6320",
    ];
    let imu = ["imu", "--proto", "mip", "--link", "/run/randt/imu"];
    for sensor in [radar, imu] {
        let unit = format!("--unit=emulate-{}", sensor[0]);
        let mut words = vec!["systemd-run", "--quiet", "--collect", "--uid=randt", &unit];
        words.extend(["/usr/bin/randt", "emulate", sensor[0], "--log", DRIVE]);
        words.extend(["--loop", "--at", &at]);
        words.extend(&sensor[1..]);
        machine.good(&words);
    }
}

/// Waits until something is so on a machine; gives how long it took.
pub fn until(what: &str, time_max: Duration, mut is_so: impl FnMut() -> bool) -> Duration {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < time_max, "{what}: waited for in vain");
        std::thread::sleep(Duration::from_millis(20));
    }
    begin.elapsed()
}

/// Waits until poses come, at full rate and good.
pub fn until_alive(machine: &Machine) -> Duration {
    until("all is alive", BOOTED_MAX, || {
        // What is not as it should be, such as IMU samples that come late on a busy machine,
        // stands behind that.
        let status = machine.status("randt-odometry");
        let rate = status.split_once(" Hz, last scan 0.");
        let is_full = rate.is_some_and(|(hz, _)| hz.parse().is_ok_and(|hz: f64| hz > 4.5));
        is_full && status.contains("s ago, trust good")
    })
}
