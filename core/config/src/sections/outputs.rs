//! Where results go: the recorder's files, the viewers, a base.

mod link;

pub use link::{Link, LinkRole, MapperHost};

use crate::rule::within;
use crate::section::section;
use crate::{HostNames, WebOrigins};

section! {
    /// What is recorded, and where.
    pub struct Record {
        /// Folder for every sweep of a Navtech with all its bins, as polar images in the Oxford
        /// data set's format, which `randt run` reads: for researchers, some 4 MB a second. Empty:
        /// none.
        pub dense: String = String::new(),
        /// Folder of the logs; a relative one is below the folder that the recorder was started
        /// in.
        pub folder: String = "randt-logs".to_owned(),
        /// Recording stops where less than this would be left on the disk, GB of 10^9 bytes, and
        /// goes on when there is more: the map's journal and the system need room too.
        pub free_min_gb: f64 = 2.0
            => within(0.0, 1e6, "0 fills the disk; a thousand terabytes, so nothing is recorded"),
        /// Delete the oldest finished log in the folder instead of stopping there.
        pub delete_oldest: bool = false,
        /// A log ends and the next one begins at this size, MB: small enough to be copied over a
        /// radio link.
        pub file_max_mb: f64 = 512.0 => within(1.0, 1e6, "a chunk or two; a terabyte"),
        /// ... or at this age, s.
        pub file_max_s: f64 = 1800.0 => within(1.0, 1e7, "a chunk or two; a third of a year"),
        /// Messages are compressed together for this time, s: what a killed recorder loses. A
        /// power cut costs up to a second, because the disk is asked to keep what it has that
        /// often.
        pub chunk_s: f64 = 0.5 => within(0.05, 1.0, "a few scans' samples; what a kill may cost"),
        /// Level of the compression (zstd). 3 leaves 3 % more on the disk, 19 a tenth less at
        /// thirty times the work.
        pub zstd_level: u32 = 5 => within(1.0, 19.0, "zstd's own"),
        /// Names of topics that are not recorded, separated by blanks, such as "radar/points/v1
        /// odometry/keyframe/v1": what the pipeline computes it computes again from radar/scan and
        /// imu/sample.
        pub leave_out: String = String::new(),
    }
}

section! {
    /// What randt-view shows, and to whom.
    pub struct View {
        /// Address with port that viewers connect to; 8765 is what they try by themselves. Nobody
        /// is asked who he is: so only this machine, and others through ssh. "0.0.0.0:8765" lets
        /// everybody in the network watch.
        pub listen: String = "127.0.0.1:8765".to_owned(),
        /// Origins of web pages that may watch, separated by blanks, such as
        /// `https://viewer.example:8443`. Lichtblick and Foxglove may without, and so may pages of
        /// the viewer's own machine and of this robot's address.
        pub origins: WebOrigins = WebOrigins::default(),
        /// Names of this robot, separated by blanks, such as "robot.example.com", where viewers
        /// use others than its addresses, localhost, its host name and HOSTNAME.local. A name that
        /// leads here and is not known is refused.
        pub host_names: HostNames = HostNames::default(),
        /// Viewers at once; one more is turned away. Each costs a few per cent of a core at most.
        pub clients_max: u32 = 8 => within(1.0, 64.0, "one viewer at least; each has buffers of its own"),
        /// Viewers at once from one address (IPv6: one /64 network), so that no viewer takes all
        /// of them. On loopback, where all come out of ssh, it does not count.
        pub clients_max_per_address: u32 = 4
            => within(1.0, 64.0, "one viewer at least; as many as there are at all"),
    }
}
