//! The sections: every key with its type, default, unit and reason, and the bounds within which it
//! runs, with theirs.

mod outputs;

use crate::Rule::{Graduation, LossShape};
use crate::rule::within;
use crate::section::section;
use crate::value::choice;
use crate::{DevicePin, SenderPin};

pub use outputs::{Link, LinkRole, MapperHost, Record, View};

section! {
    /// Beam-wise cluster filter (paper, III-A).
    pub struct Filter {
        /// Returns farther than this are left out, m; the sensor's own reach ends them too.
        /// No environment but an indoor one ends the useful range before the sensor does.
        pub range_max_m: f64 = 100.0
            => within(0.5, 1000.0, "nearer is the robot itself; no radar for robots reaches farther"),
    }
}

section! {
    /// Attitude filter (Valenti et al. 2015) and standstill detection.
    pub struct Attitude {
        /// Time over which the accelerometer corrects the tilt, s. Long against a robot's pushes
        /// and brakes, which look like tilt; short against the drift of a gyro whose bias is known
        /// to 0.05 deg/s.
        pub correction_time_s: f64 = 3.0
            => within(0.1, 1000.0, "shorter follows every push, longer leaves the tilt to the gyro"),
        /// Relative deviation of |a| from gravity up to which the gain is whole; it falls to 0 at
        /// twice this.
        pub gravity_tolerance: f64 = 0.1
            => within(0.001, 10.0, "gravity differs by half of that on Earth; above, the deviation never counts"),
        /// Length of the window that is tested for standstill, s. Long enough to average noise,
        /// shorter than most stops.
        pub standstill_window_s: f64 = 1.0
            => within(0.1, 60.0, "shorter has too few samples; few robots stand for longer than a minute"),
        /// Standard deviation of the rate (root of the axes' sum) below which a window is still,
        /// rad/s. Between the noise of MEMS gyros at rest (0.0033..0.0058) and a wheeled robot's
        /// smoothest drive (0.0094).
        pub standstill_rate_rad_s: f64 = 0.0075
            => within(1e-12, 1.0, "below any gyro's noise, so never still; above, every slow turn is a standstill"),
        /// The same of the specific force, m/s^2. Cheap accelerometers have 0.1 at rest; the rate
        /// does the finer part.
        pub standstill_acceleration_m_s2: f64 = 0.2
            => within(0.001, 10.0, "below any accelerometer's noise; above, gravity itself"),
        /// Largest bias that a gyro can have, rad/s: 1.5 deg/s, about what data sheets of MEMS
        /// gyros allow. A steady turn below it, before any bias is known, passes for one.
        pub standstill_bias_max_rad_s: f64 = 0.026
            => within(0.00001, 1.0, "better than any gyro; above, every slow turn is a bias"),
        /// Largest change of the mean rate inside a window and from the bias that is known, rad/s
        /// (0.3 deg/s). Twice what standing robots show from one half second to the next: they
        /// sway a little.
        pub standstill_bias_change_rad_s: f64 = 0.005
            => within(0.000001, 1.0, "better than any gyro; above, every slow turn is a bias"),
    }
}

section! {
    /// Normal distributions transform (paper, III-B).
    pub struct Ndt {
        /// Edge of a cell, m (paper: 0.5 indoor, 1.2 outdoor, 1.0 mixed, 3.5 Oxford).
        pub cell_size_m: f64 = 1.0 => within(0.05, 100.0, "three range bins; a street's width"),
        /// Points from which a cell is used (paper: more than 5 indoor, 3 elsewhere, 10 Oxford).
        pub points_min: u32 = 4
            => within(2.0, 10000.0, "two points have a spread; no cell has more points than that in a scan"),
        /// Use intensity as the third dimension.
        pub intensity: bool = true,
        /// How much wider a cell is made along a direction in which its points fill the square: by
        /// 1 + slack where a wall runs through. Squares move with the robot and would hold it back
        /// along bare walls.
        pub slack: f64 = 5.0
            => within(0.0, 1000.0, "0 believes walls as they are cut; above, a wall holds nothing along itself"),
    }
}

section! {
    /// Sliding-window motion estimation (paper, III-C).
    pub struct Odometry {
        /// Scans in the window, l of the paper.
        pub window: u32 = 3
            => within(1.0, 20.0, "the newest scan at least; more scans cost time and add nothing new"),
        /// Remove the motion inside a sweep, beam by beam.
        pub deskew: bool = true,
        /// Submap cells that each scan cell is compared with (paper: 4, Oxford 2).
        pub neighbours: u32 = 4 => within(1.0, 4.0, "one lane each of the SIMD registers"),
        /// Use what the robot measures of its own velocity (robot/twist: wheels), where there is
        /// something, scaled and as far as radar and IMU do not contradict it.
        pub use_twist: bool = true,
        /// Shape of the adaptive loss, a multiple of 0.5 below 2 (paper: -2 indoor, -1 outdoor,
        /// -1.5 mixed, -2 Oxford).
        pub loss_alpha: f64 = -1.5 => LossShape,
        /// Scale c of the adaptive loss (the code's c; the paper prints it divided by sqrt 2).
        pub loss_scale: f64 = 2.0 => within(0.01, 100.0, "below, every cell is an outlier; above, none is"),
        /// Graduation: factors on c^2, one solve each, down to 1; associations are made again at
        /// each.
        pub graduation: Vec<f64> = vec![1.21, 1.1, 1.0] => Graduation,
        /// Information of the NDT term per scan, shared among its cells and neighbours. The
        /// paper's 50000 over the window claims half a millimetre; 200 gives the centimetre that
        /// recordings show, and a calm velocity.
        pub ndt_weight: f64 = 200.0 => within(0.01, 1e7, "10 m and a third of a millimetre a scan"),
        /// Standard deviation of the acceleration that the motion model allows, m/s^2.
        pub acceleration_sigma_m_s2: f64 = 1.0
            => within(0.001, 1000.0, "a robot that cannot change its speed; a hundred times gravity"),
        /// The same sideways, m/s^2: wheels slip little (the paper's model has a third of the
        /// forward one).
        pub lateral_acceleration_sigma_m_s2: f64 = 0.33 => within(0.001, 1000.0, "the same"),
        /// Standard deviation of the angular acceleration that the motion model allows without an
        /// IMU, rad/s^2.
        pub angular_acceleration_sigma_rad_s2: f64 = 0.5
            => within(0.0001, 1000.0, "a robot that cannot change its turn; a turn from nothing in a sweep"),
        /// White noise of the gyro's yaw rate, rad/s per square root of Hz, with vibration.
        pub gyro_noise_rad_s_sqrt_hz: f64 = 0.0003
            => within(1e-8, 1.0, "better than a ring laser; worse than no gyro"),
        /// Random walk of the gyro's bias, rad/s per square root of s.
        pub gyro_bias_walk: f64 = 0.00003
            => within(1e-10, 1.0, "better than a ring laser; worse than no gyro"),
        /// Standard deviation of the gyro's bias at the start, rad/s (before a standstill was
        /// seen).
        pub gyro_bias_sigma_rad_s: f64 = 0.01
            => within(1e-7, 10.0, "better than a ring laser; worse than no gyro"),
        /// How late the radar's stamps are against the IMU's, s: taken off them. `randt calibrate
        /// time` finds it.
        pub radar_late_s: f64 = 0.0 => within(-1.0, 1.0, "later than several sweeps is another fault"),
        /// Longest wait for an IMU sample at or after a sweep's end, s of data time.
        pub imu_wait_max_s: f64 = 0.1
            => within(0.0, 60.0, "0 waits for nothing; a minute is longer than any pause of a living IMU"),
        /// A gap between sweeps above this opens a new odometry frame, s.
        pub gap_max_s: f64 = 1.0
            => within(0.01, 60.0, "shorter than any sweep; after a minute the robot may be anywhere"),
        /// The same where a gyro measured the turn throughout, s. Then the speed alone is guessed:
        /// after 3 s it is off by what registration still finds.
        pub gap_with_gyro_max_s: f64 = 3.0
            => within(0.01, 60.0, "shorter than any sweep; after a minute the robot may be anywhere"),
        /// Fastest speed that the platform can have, m/s; an estimate above it is lost.
        pub speed_max_m_s: f64 = 20.0 => within(0.1, 100.0, "a crawl; faster than any car on a road"),
    }
}

section! {
    /// Keyframes (paper, III-D; by distance and angle, none at standstill).
    pub struct Keyframe {
        /// A keyframe at least after this distance, m.
        pub distance_m: f64 = 0.5
            => within(0.02, 50.0, "what a pose is known to; a Navtech's scans farther apart have little in common"),
        /// A keyframe at least after this turn, rad.
        pub angle_rad: f64 = 0.35 => within(0.01, 10.0, "half a degree; above pi never by angle"),
    }
}

section! {
    /// Submaps that scans are registered to.
    pub struct Submap {
        /// A submap is closed when the robot is this far from its root, m: about the sensor's
        /// reach, since each change of submap costs a little drift.
        pub radius_m: f64 = 15.0 => within(0.5, 1000.0, "a few cells; no radar for robots reaches farther"),
        /// The next submap is begun this far before the end, m, so that both hold the overlap's
        /// scans.
        pub overlap_m: f64 = 5.0 => within(0.0, 1000.0, "below the radius"),
        /// A scan enters when the robot has moved this far since the last one that did, m:
        /// standing still must not outweigh driving.
        pub insert_distance_m: f64 = 0.05
            => within(0.0, 100.0, "0 takes every scan; farther apart a submap has holes"),
        /// ... or has turned this far, rad.
        pub insert_angle_rad: f64 = 0.05 => within(0.0, 10.0, "0 takes every scan; above pi never by angle"),
    }
}

section! {
    /// Loop closure (paper, III-D): which keyframes stand where the robot was before.
    pub struct Loops {
        /// Search for loops.
        pub enabled: bool = true,
        /// Verify each candidate before it enters the graph. Without it the best candidate is
        /// believed as it is: for experiments only, one false loop breaks a map.
        pub verify: bool = true,
        /// Factor on the covariance of odometry's steps, which takes their errors for independent.
        /// They are not: scans of one submap share its errors, and on drives with truth odometry
        /// is off by 4 times what its steps add up to.
        pub odometry_covariance_factor: f64 = 16.0
            => within(0.001, 1e6, "a thirtieth and a thousandfold of the standard deviation"),
        /// Path after which meeting a place again is a loop, m; before it odometry's own submaps
        /// hold it.
        pub path_min_m: f64 = 15.0
            => within(0.1, 1e7, "above a keyframe's step; longer than any drive, so no loops at all"),
        /// Laps of one place whose keyframes stay in the graph. Those of later laps that find their
        /// loops are taken out once they lie behind: the graph then grows with the ground, not
        /// with the way. 0 keeps all.
        pub laps_max: u32 = 3
            => within(0.0, 1e6, "0 keeps all; more than any drive has, so all as well"),
        /// ScanContext: rings (paper: 20, Oxford 30).
        pub rings: u32 = 20
            => within(1.0, 200.0, "one is the range alone; more are narrower than what a pose is known to"),
        /// ScanContext: sectors (paper: 45 indoor, 60 elsewhere, 120 Oxford).
        pub sectors: u32 = 60
            => within(4.0, 720.0, "quarters of a turn; half a degree, narrower than any beam"),
        /// ScanContext: radius, m (paper: 15, Oxford 90).
        pub radius_m: f64 = 15.0
            => within(0.5, 1000.0, "nearer is the robot itself; no radar for robots reaches farther"),
        /// Keyframes of nearest ring key that are compared sector by sector (paper: 10).
        pub candidates: u32 = 10 => within(1.0, 100.0, "the nearest alone; more are no nearer and cost time"),
        /// Share of each place's surroundings that the other's must explain.
        pub fit_min: f64 = 0.4 => within(0.0, 1.0, "a share"),
        /// Largest Cauchy-Schwarz divergence of a loop. The paper's 3.6 to 4.0 belong to its
        /// code's sums, which lack a factor.
        pub divergence_max: f64 = 2.0 => within(0.0, 1000.0, "0 refuses every loop; above, none"),
    }
}

section! {
    /// Occupancy grid.
    pub struct Grid {
        /// Edge of a cell, m: half a door's frame, and what planners for indoor robots use.
        pub cell_size_m: f64 = 0.1 => within(0.01, 10.0, "below a range bin; above a room"),
        /// Keyframes that must have had a return from a cell before it is occupied: an echo by way
        /// of a mirror seldom comes from one place twice.
        pub hits_min: u32 = 2
            => within(1.0, 1000000.0, "one return at least; more than a drive has keyframes, so never"),
        /// Keyframes that must have looked through a cell before it is free: one alone may have
        /// looked through a wall.
        pub misses_min: u32 = 2
            => within(1.0, 1000000.0, "one beam at least; more than a drive has keyframes, so never"),
        /// Of the keyframes that speak of a cell, the share that must have had a return from it
        /// before it is occupied. Low, because a beam that grazes a wall passes through its cells
        /// before it comes back from one of them, and because a wrong wall costs a detour and a
        /// missing one the robot. Simulated: 0.2 finds 93 % of the walls that were seen, 0.5 finds
        /// 85 %, with as few wrong cells.
        pub occupied_share: f64 = 0.2 => within(0.0, 1.0, "a share"),
    }
}

section! {
    /// What is particular to one radar.
    pub struct Sensor {
        /// Name of the sensor.
        pub name: String = "isdr-c".to_owned(),
        /// Returns nearer than this are left out, m (radome echo).
        pub range_min_m: f64 = 0.6
            => within(0.0, 1000.0, "0 leaves nothing out; no radar for robots reaches farther"),
        /// Reach of the sensor, m.
        pub range_max_m: f64 = 16.0
            => within(0.5, 1000.0, "nearer is the robot itself; no radar for robots reaches farther"),
        /// Returns need an intensity above this, in the sensor's unit.
        pub intensity_min: f64 = 6.0 => within(0.0, 65535.0, "0 takes all; sensors have 16 bits"),
        /// Returns at or below this power are left out by the driver, and counted: about 30,000 of
        /// a Navtech's 1.5 million bins a sweep are above its floor. 0 where the sensor has a
        /// threshold of its own.
        pub keep_power: f64 = 0.0 => within(0.0, 65535.0, "0 keeps all; sensors have 16 bits"),
        /// Largest step in range between neighbouring returns of one cluster, m.
        pub connectivity_m: f64 = 0.04
            => within(0.0001, 100.0, "below any range bin; one cluster for every beam"),
        /// Width of a range bin, m.
        pub range_resolution_m: f64 = 0.0161
            => within(0.0001, 10.0, "a bin of the finest radar; a bin wider than a cell"),
        /// Angle between beams, rad.
        pub azimuth_step_rad: f64 = 0.028_56
            => within(0.006135, 1.0, "a sweep has at most 1,024 beams; six beams a turn are no picture"),
        /// Smallest useful NDT cell, m; the larger of this and ndt.cell_size_m counts. Far returns
        /// lie a beam's spacing apart: smaller cells would stay empty. 0 leaves it to the
        /// environment.
        pub cell_size_min_m: f64 = 0.0
            => within(0.0, 100.0, "0 leaves it to the environment; a street's width"),
        /// Standard deviation of a cell's direction, rad: a third of the beam's width, as many
        /// beams see one cell.
        pub azimuth_sigma_rad: f64 = 0.01
            => within(0.0, 1.0, "0 believes the beam; above, a third of a turn"),
        /// Time of one turn, s.
        pub period_s: f64 = 0.2
            => within(0.01, 10.0, "100 turns a second; slower is no sweep of a moving robot"),
    }
}

section! {
    /// Where the sensors sit on the robot.
    pub struct Robot {
        /// Radar in base_link, x, m.
        pub radar_x_m: f64 = 0.0 => within(-100.0, 100.0, "it stands on the robot"),
        /// Radar in base_link, y, m.
        pub radar_y_m: f64 = 0.0 => within(-100.0, 100.0, "it stands on the robot"),
        /// Radar in base_link, yaw, rad.
        pub radar_yaw_rad: f64 = 0.0 => within(-6.3, 6.3, "a turn in radians, not in degrees"),
        /// IMU in base_link, roll, rad (pi when it hangs upside down).
        pub imu_roll_rad: f64 = 0.0 => within(-6.3, 6.3, "a turn in radians, not in degrees"),
        /// IMU in base_link, pitch, rad.
        pub imu_pitch_rad: f64 = 0.0 => within(-6.3, 6.3, "a turn in radians, not in degrees"),
        /// IMU in base_link, yaw, rad.
        pub imu_yaw_rad: f64 = 0.0 => within(-6.3, 6.3, "a turn in radians, not in degrees"),
    }
}

choice! {
    /// Which radar is driven.
    pub enum RadarSource ("\"navtech\" or \"beam-udp\"") {
        /// A Navtech CTS or CIR by its own protocol, Colossus over TCP.
        Navtech = "navtech",
        /// Any radar that is bridged to the protocol of docs/beam-udp.md: the iSDR-C's own is not
        /// public.
        BeamUdp = "beam-udp",
    }
}

choice! {
    /// Which byte of the stamps of a Navtech's azimuths comes first: the vendor's own programs
    /// disagree.
    pub enum ByteOrder ("\"auto\", \"le\" or \"be\"") {
        /// Whichever makes successive stamps follow each other.
        Auto = "auto",
        /// The lowest.
        Little = "le",
        /// The highest.
        Big = "be",
    }
}

choice! {
    /// Which IMU is driven.
    pub enum ImuSource ("\"phidget22\", \"mip\", \"xsens\" or \"line\"") {
        /// A Phidgets Spatial by the vendor's library, over USB or from a network server.
        Phidget22 = "phidget22",
        /// A MicroStrain on a serial port.
        Mip = "mip",
        /// An Xsens MTi on a serial port (MTData2).
        Xsens = "xsens",
        /// Any IMU that sends the text lines of docs/lines.md, on a serial port or by UDP.
        Line = "line",
    }
}

section! {
    /// How randt-radar reaches the radar.
    pub struct RadarDriver {
        /// The radar's protocol: navtech or beam-udp.
        pub source: RadarSource = RadarSource::BeamUdp,
        /// navtech: the radar's address with port, 6317 by the vendor. beam-udp: what is listened
        /// on; a multicast group is joined.
        pub address: String = "0.0.0.0:6320".to_owned(),
        /// beam-udp from a multicast group: this host's address on the radar's network; empty
        /// leaves it to the kernel.
        pub interface: String = String::new(),
        /// beam-udp: the radar's device number; what has another one is left out and counted.
        /// "any" takes the first device that sends whole sweeps, and doubts them while another one
        /// sends too.
        pub device: DevicePin = DevicePin::default(),
        /// beam-udp: the IP that the radar's datagrams come from, with or without its port,
        /// likewise. Set it wherever others can reach radar.address: all of them can send sweeps.
        pub sender: SenderPin = SenderPin::default(),
        /// navtech: order of bytes in the stamps of azimuths: auto, le or be.
        pub byte_order: ByteOrder = ByteOrder::Auto,
        /// Receive buffer that is asked of the kernel, bytes: a second of an iSDR-C's beams, so
        /// that a busy moment of the machine loses none. net.core.rmem_max must allow it.
        pub receive_buffer_bytes: u32 = 4_194_304
            => within(65536.0, 1073741824.0, "one datagram; a gibibyte, what the kernel allows at most"),
        /// Without a beam for this time the radar is reported as silent, and a connection is made
        /// anew, s.
        pub silence_s: f64 = 1.0
            => within(0.1, 60.0, "shorter than a slow turn of the dish; longer is no answer to a cut cable"),
    }
}

section! {
    /// How randt-imu reaches the IMU.
    pub struct ImuDriver {
        /// The IMU's protocol: phidget22, mip, xsens or line.
        pub source: ImuSource = ImuSource::Phidget22,
        /// mip, xsens, line: the serial port, by /dev/serial/by-id so that it is found again under
        /// another number. line by UDP: what is listened on, such as 0.0.0.0:6321. phidget22: the
        /// serial number; empty takes the first one.
        pub device: String = String::new(),
        /// line by UDP: the IP that the IMU's datagrams come from, with or without its port; what
        /// comes from elsewhere is left out and counted. "any" takes the first one that sends
        /// lines, until it is silent.
        pub sender: SenderPin = SenderPin::default(),
        /// Where lines with the robot's velocity come from (docs/lines.md), likewise a serial port
        /// or an address. Empty: from the IMU's own wire, where that has lines, else nowhere.
        pub twist_device: String = String::new(),
        /// The sender of these, where they come by UDP, as of the IMU's.
        pub twist_sender: SenderPin = SenderPin::default(),
        /// phidget22: a Phidget network server, with port (5661 by the vendor), instead of USB.
        pub server: String = String::new(),
        /// phidget22: the path of libphidget22; empty leaves the search to the system.
        pub library: String = String::new(),
        /// mip, xsens, line: speed of the serial port, baud.
        pub baud: u32 = 115_200
            => within(9600.0, 4000000.0, "too slow for 250 samples; faster than any port"),
        /// Samples a second that are asked of the device, Hz: odometry is made for 250.
        pub rate_hz: f64 = 250.0
            => within(1.0, 1000.0, "slower is no help in a sweep; faster than any of the devices"),
        /// The device's signed axes that are x, y and z of the IMU, for rates.
        pub rate_axes: String = "+x +y +z".to_owned(),
        /// The same for accelerations. What a device calls its acceleration may be gravity or what
        /// holds it up, and only one of them points up: at rest z must read +9.81 m/s^2. `randt
        /// doctor sensors` reports it when it does not.
        pub acceleration_axes: String = "+x +y +z".to_owned(),
        /// Without a sample for this time the IMU is reported as silent, and opened anew, s.
        pub silence_s: f64 = 0.5 => within(0.1, 60.0, "a few samples; longer is no answer to a pulled plug"),
    }
}
