//! The sections: every key with its type, default, range, unit and reason.

use crate::Rule::{AtLeast, Graduation, LossShape, NotNegative, Positive, Within};
use crate::section::section;
use crate::value::choice;

section! {
    /// Beam-wise cluster filter (paper, III-A).
    pub struct Filter {
        /// Returns farther than this are left out, m; the sensor's own reach ends them too.
        /// No environment but an indoor one ends the useful range before the sensor does.
        pub range_max_m: f64 = 100.0 => Positive,
    }
}

section! {
    /// Attitude filter (Valenti et al. 2015) and standstill detection.
    pub struct Attitude {
        /// Time over which the accelerometer corrects the tilt, s. Long against a robot's pushes and brakes, which
        /// look like tilt; short against the drift of a gyro whose bias is known to 0.05 deg/s.
        pub correction_time_s: f64 = 3.0 => Positive,
        /// Relative deviation of |a| from gravity up to which the gain is whole; it falls to 0 at twice this.
        pub gravity_tolerance: f64 = 0.1 => Positive,
        /// Length of the window that is tested for standstill, s. Long enough to average noise, shorter than most stops.
        pub standstill_window_s: f64 = 1.0 => Within(0.1, 60.0),
        /// Standard deviation of the rate (root of the axes' sum) below which a window is still, rad/s.
        /// Between the noise of MEMS gyros at rest (0.0033..0.0058) and a wheeled robot's smoothest drive (0.0094).
        pub standstill_rate_rad_s: f64 = 0.0075 => Positive,
        /// The same of the specific force, m/s^2. Cheap accelerometers have 0.1 at rest; the rate does the finer part.
        pub standstill_acceleration_m_s2: f64 = 0.2 => Positive,
        /// Largest bias that a gyro can have, rad/s: 1.5 deg/s, about what data sheets of MEMS gyros allow.
        /// A steady turn below it, before any bias is known, passes for one.
        pub standstill_bias_max_rad_s: f64 = 0.026 => Positive,
        /// Largest change of the mean rate inside a window and from the bias that is known, rad/s (0.3 deg/s).
        /// Twice what standing robots show from one half second to the next: they sway a little.
        pub standstill_bias_change_rad_s: f64 = 0.005 => Positive,
    }
}

section! {
    /// Normal distributions transform (paper, III-B).
    pub struct Ndt {
        /// Edge of a cell, m (paper: 0.5 indoor, 1.2 outdoor, 1.0 mixed, 3.5 Oxford).
        pub cell_size_m: f64 = 1.0 => Within(0.05, 100.0),
        /// Points from which a cell is used (paper: more than 5 indoor, 3 elsewhere, 10 Oxford).
        pub points_min: u32 = 4 => AtLeast(2.0),
        /// Use intensity as the third dimension.
        pub intensity: bool = true,
        /// How much wider a cell is made along a direction in which its points fill the square: by 1 + slack where a wall
        /// runs through. Squares move with the robot and would hold it back along bare walls.
        pub slack: f64 = 5.0 => NotNegative,
    }
}

section! {
    /// Sliding-window motion estimation (paper, III-C).
    pub struct Odometry {
        /// Scans in the window, l of the paper.
        pub window: u32 = 3 => Within(1.0, 20.0),
        /// Remove the motion inside a sweep, beam by beam.
        pub deskew: bool = true,
        /// Submap cells that each scan cell is compared with (paper: 4, Oxford 2).
        pub neighbours: u32 = 4 => Within(1.0, 16.0),
        /// Shape of the adaptive loss, a multiple of 0.5 below 2 (paper: -2 indoor, -1 outdoor, -1.5 mixed, -2 Oxford).
        pub loss_alpha: f64 = -1.5 => LossShape,
        /// Scale c of the adaptive loss (the code's c; the paper prints it divided by sqrt 2).
        pub loss_scale: f64 = 2.0 => Positive,
        /// Graduation: factors on c^2, one solve each, down to 1; associations are made again at each.
        pub graduation: Vec<f64> = vec![1.21, 1.1, 1.0] => Graduation,
        /// Information of the NDT term per scan, shared among its cells and neighbours. The paper's 50000 over the
        /// window claims half a millimetre; 200 gives the centimetre that recordings show, and a calm velocity.
        pub ndt_weight: f64 = 200.0 => Positive,
        /// Standard deviation of the acceleration that the motion model allows, m/s^2.
        pub acceleration_sigma_m_s2: f64 = 1.0 => Positive,
        /// The same sideways, m/s^2: wheels slip little (the paper's model has a third of the forward one).
        pub lateral_acceleration_sigma_m_s2: f64 = 0.33 => Positive,
        /// Standard deviation of the angular acceleration that the motion model allows without an IMU, rad/s^2.
        pub angular_acceleration_sigma_rad_s2: f64 = 0.5 => Positive,
        /// White noise of the gyro's yaw rate, rad/s per square root of Hz, with vibration.
        pub gyro_noise_rad_s_sqrt_hz: f64 = 0.0003 => Positive,
        /// Random walk of the gyro's bias, rad/s per square root of s.
        pub gyro_bias_walk: f64 = 0.00003 => Positive,
        /// Standard deviation of the gyro's bias at the start, rad/s (before a standstill was seen).
        pub gyro_bias_sigma_rad_s: f64 = 0.01 => Positive,
        /// How late the radar's stamps are against the IMU's, s: taken off them. `randt calibrate time` finds it.
        pub radar_late_s: f64 = 0.0 => Within(-1.0, 1.0),
        /// Longest wait for an IMU sample at or after a sweep's end, s of data time.
        pub imu_wait_max_s: f64 = 0.1 => NotNegative,
        /// A gap between sweeps above this opens a new odometry frame, s.
        pub gap_max_s: f64 = 1.0 => Positive,
        /// Fastest speed that the platform can have, m/s; an estimate above it is lost.
        pub speed_max_m_s: f64 = 20.0 => Positive,
        /// A scan whose position information is weaker in one direction than in the other by more than this share
        /// leaves that direction to gyro and motion model: a bare corridor. Trust is then degraded.
        pub degenerate_ratio: f64 = 0.01 => Within(0.0, 1.0),
    }
}

section! {
    /// Keyframes (paper, III-D; by distance and angle, none at standstill).
    pub struct Keyframe {
        /// A keyframe at least every so many metres.
        pub distance_m: f64 = 0.5 => Positive,
        /// A keyframe at least every so many radians.
        pub angle_rad: f64 = 0.35 => Positive,
    }
}

section! {
    /// Submaps that scans are registered to.
    pub struct Submap {
        /// A submap is closed when the robot is this far from its root, m: about the sensor's reach, since each change
        /// of submap costs a little drift.
        pub radius_m: f64 = 15.0 => Within(0.5, 1000.0),
        /// The next submap is begun this far before the end, m, so that both hold the overlap's scans.
        pub overlap_m: f64 = 5.0 => NotNegative,
        /// A scan enters when the robot has moved this far since the last one that did, m: standing still must not
        /// outweigh driving.
        pub insert_distance_m: f64 = 0.05 => NotNegative,
        /// ... or has turned this far, rad.
        pub insert_angle_rad: f64 = 0.05 => NotNegative,
    }
}

section! {
    /// Loop closure (paper, III-D): which keyframes stand where the robot was before.
    pub struct Loops {
        /// Search for loops.
        pub enabled: bool = true,
        /// Verify each candidate before it enters the graph. Without it the best candidate is believed as it is: for
        /// experiments only, one false loop breaks a map.
        pub verify: bool = true,
        /// Factor on the covariance of odometry's steps, which takes their errors for independent. They are not: scans
        /// of one submap share its errors, and on drives with truth odometry is off by 4 times what its steps add up to.
        pub odometry_covariance_factor: f64 = 16.0 => Positive,
        /// Path after which meeting a place again is a loop, m; before it odometry's own submaps hold it.
        pub path_min_m: f64 = 15.0 => Positive,
        /// ScanContext: rings (paper: 20, Oxford 30).
        pub rings: u32 = 20 => Within(1.0, 200.0),
        /// ScanContext: sectors (paper: 45 indoor, 60 elsewhere, 120 Oxford).
        pub sectors: u32 = 60 => Within(4.0, 720.0),
        /// ScanContext: radius, m (paper: 15, Oxford 90).
        pub radius_m: f64 = 15.0 => Positive,
        /// Keyframes of nearest ring key that are compared sector by sector (paper: 10).
        pub candidates: u32 = 10 => Within(1.0, 100.0),
        /// Share of each place's surroundings that the other's must explain.
        pub fit_min: f64 = 0.4 => Within(0.0, 1.0),
        /// Largest Cauchy-Schwarz divergence of a loop. The paper's 3.6 to 4.0 belong to its code's sums, which lack a
        /// factor.
        pub divergence_max: f64 = 2.0 => Positive,
    }
}

section! {
    /// Occupancy grid.
    pub struct Grid {
        /// Edge of a cell, m: half a door's frame, and what planners for indoor robots use.
        pub cell_size_m: f64 = 0.1 => Within(0.01, 10.0),
        /// Keyframes that must have had a return from a cell before it is occupied: an echo by way of a mirror seldom
        /// comes from one place twice.
        pub hits_min: u32 = 2 => AtLeast(1.0),
        /// Keyframes that must have looked through a cell before it is free: one alone may have looked through a wall.
        pub misses_min: u32 = 2 => AtLeast(1.0),
        /// Of the keyframes that speak of a cell, the share that must have had a return from it before it is occupied.
        /// Low, because a beam that grazes a wall passes through its cells before it comes back from one of them, and
        /// because a wrong wall costs a detour and a missing one the robot. Simulated: 0.2 finds 93 % of the walls that
        /// were seen, 0.5 finds 85 %, with as few wrong cells.
        pub occupied_share: f64 = 0.2 => Within(0.0, 1.0),
    }
}

section! {
    /// What is particular to one radar.
    pub struct Sensor {
        /// Name of the sensor.
        pub name: String = "isdr-c".to_owned(),
        /// Returns nearer than this are left out, m (radome echo).
        pub range_min_m: f64 = 0.6 => NotNegative,
        /// Reach of the sensor, m.
        pub range_max_m: f64 = 16.0 => Positive,
        /// Returns need an intensity above this, in the sensor's unit.
        pub intensity_min: f64 = 6.0 => NotNegative,
        /// Returns at or below this power are left out by the driver, and counted: about 30,000 of a Navtech's 1.5 million
        /// bins a sweep are above its floor. 0 where the sensor has a threshold of its own.
        pub keep_power: f64 = 0.0 => NotNegative,
        /// Largest step in range between neighbouring returns of one cluster, m.
        pub connectivity_m: f64 = 0.04 => Positive,
        /// Width of a range bin, m.
        pub range_resolution_m: f64 = 0.0161 => Positive,
        /// Angle between beams, rad.
        pub azimuth_step_rad: f64 = 0.028_56 => Within(0.001, 1.0),
        /// Smallest useful NDT cell, m; the larger of this and ndt.cell_size_m counts. Far returns lie a beam's spacing
        /// apart: smaller cells would stay empty. 0 leaves it to the environment.
        pub cell_size_min_m: f64 = 0.0 => NotNegative,
        /// Standard deviation of a cell's direction, rad: a third of the beam's width, as many beams see one cell.
        pub azimuth_sigma_rad: f64 = 0.01 => NotNegative,
        /// Time of one turn, s.
        pub period_s: f64 = 0.2 => Positive,
    }
}

section! {
    /// Where the sensors sit on the robot.
    pub struct Robot {
        /// Radar in base_link, x, m.
        pub radar_x_m: f64 = 0.0,
        /// Radar in base_link, y, m.
        pub radar_y_m: f64 = 0.0,
        /// Radar in base_link, yaw, rad.
        pub radar_yaw_rad: f64 = 0.0,
        /// IMU in base_link, roll, rad (pi when it hangs upside down).
        pub imu_roll_rad: f64 = 0.0,
        /// IMU in base_link, pitch, rad.
        pub imu_pitch_rad: f64 = 0.0,
        /// IMU in base_link, yaw, rad.
        pub imu_yaw_rad: f64 = 0.0,
    }
}

choice! {
    /// Which radar is driven.
    pub enum RadarSource ("\"navtech\" or \"beam-udp\"") {
        /// A Navtech CTS or CIR by its own protocol, Colossus over TCP.
        Navtech = "navtech",
        /// Any radar that somebody bridges to the protocol of docs/beam-udp.md: the iSDR-C's own is not public.
        BeamUdp = "beam-udp",
    }
}

choice! {
    /// Which byte of the stamps of a Navtech's azimuths comes first: the vendor's own programs disagree.
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
    pub enum ImuSource ("\"phidget22\", \"mip\" or \"xsens\"") {
        /// A Phidgets Spatial by the vendor's library, over USB or from a network server.
        Phidget22 = "phidget22",
        /// A MicroStrain on a serial port.
        Mip = "mip",
        /// An Xsens MTi on a serial port (MTData2).
        Xsens = "xsens",
    }
}

section! {
    /// How randt-radar reaches the radar.
    pub struct RadarDriver {
        /// The radar's protocol: navtech or beam-udp.
        pub source: RadarSource = RadarSource::BeamUdp,
        /// navtech: the radar's address with port, 6317 by the vendor. beam-udp: what is listened on; a multicast group is
        /// joined.
        pub address: String = "0.0.0.0:6320".to_owned(),
        /// beam-udp from a multicast group: this host's address on the radar's network; empty leaves it to the kernel.
        pub interface: String = String::new(),
        /// navtech: order of bytes in the stamps of azimuths: auto, le or be.
        pub byte_order: ByteOrder = ByteOrder::Auto,
        /// Receive buffer that is asked of the kernel, bytes: a second of an iSDR-C's beams, so that a busy moment of the
        /// machine loses none. net.core.rmem_max must allow it.
        pub receive_buffer_bytes: u32 = 4_194_304 => Within(65_536.0, 1_073_741_824.0),
        /// Without a beam for so long the radar is said to be silent, and a connection is made anew, s.
        pub silence_s: f64 = 1.0 => Within(0.1, 60.0),
    }
}

section! {
    /// How randt-imu reaches the IMU.
    pub struct ImuDriver {
        /// The IMU's protocol: phidget22, mip or xsens.
        pub source: ImuSource = ImuSource::Phidget22,
        /// mip, xsens: the serial port, by /dev/serial/by-id so that it is found again under another number. phidget22: the
        /// serial number; empty takes the first one.
        pub device: String = String::new(),
        /// phidget22: a Phidget network server, with port (5661 by the vendor), instead of USB.
        pub server: String = String::new(),
        /// phidget22: the path of libphidget22; empty leaves the search to the system.
        pub library: String = String::new(),
        /// mip, xsens: speed of the serial port, baud.
        pub baud: u32 = 115_200 => Within(9600.0, 4_000_000.0),
        /// Samples a second that are asked of the device, Hz: odometry is made for 250.
        pub rate_hz: f64 = 250.0 => Within(1.0, 1000.0),
        /// The device's signed axes that are x, y and z of the IMU, for rates.
        pub rate_axes: String = "+x +y +z".to_owned(),
        /// The same for accelerations. What a device calls its acceleration may be gravity or what holds it up, and only one
        /// of them points up: at rest z must read +9.81 m/s^2. `randt doctor sensors` says when it does not.
        pub acceleration_axes: String = "+x +y +z".to_owned(),
        /// Without a sample for so long the IMU is said to be silent, and opened anew, s.
        pub silence_s: f64 = 0.5 => Within(0.1, 60.0),
    }
}

section! {
    /// What is recorded, and where.
    pub struct Record {
        /// Folder for every sweep of a Navtech with all its bins, as polar images in the Oxford data set's format, which
        /// `randt run` reads: for researchers, some 4 MB a second. Empty: none.
        pub dense: String = String::new(),
        /// Folder of the logs; a relative one is below the folder that the recorder was started in.
        pub folder: String = "randt-logs".to_owned(),
        /// Recording stops where less than this would be left on the disk, GB of 10^9 bytes, and goes on when there is more:
        /// the map's journal and the system need room too.
        pub free_min_gb: f64 = 2.0 => NotNegative,
        /// Delete the oldest finished log in the folder instead of stopping there.
        pub delete_oldest: bool = false,
        /// A log ends and the next one begins at this size, MB: small enough to be copied over a radio link.
        pub file_max_mb: f64 = 512.0 => Positive,
        /// ... or at this age, s.
        pub file_max_s: f64 = 1800.0 => Positive,
        /// Messages are compressed together for so long, s: what a killed recorder loses. A power cut costs up to a second,
        /// because the disk is asked to keep what it has that often.
        pub chunk_s: f64 = 0.5 => Within(0.05, 1.0),
        /// Level of the compression (zstd). 3 leaves 3 % more on the disk, 19 a tenth less at thirty times the work.
        pub zstd_level: u32 = 5 => Within(1.0, 19.0),
        /// Names of topics that are not recorded, separated by blanks, such as "radar/points/v1 odometry/keyframe/v1": what
        /// the pipeline computes it computes again from radar/scan and imu/sample.
        pub leave_out: String = String::new(),
    }
}

section! {
    /// What randt-view shows, and to whom.
    pub struct View {
        /// Address with port that viewers connect to; 8765 is what they try by themselves. Nobody is asked who he is: so only
        /// this machine, and others through ssh. "0.0.0.0:8765" lets everybody in the network watch.
        pub listen: String = "127.0.0.1:8765".to_owned(),
        /// Viewers at once; one more is turned away. Each costs a few per cent of a core at most.
        pub clients_max: u32 = 8 => Within(1.0, 64.0),
    }
}
