//! The link between a robot and a base.

use crate::rule::within;
use crate::section::section;
use crate::value::choice;

choice! {
    /// Which end of the link this machine is.
    pub enum LinkRole ("\"robot\" or \"base\"") {
        /// The one that drives: it calls the base.
        Robot = "robot",
        /// The one that watches: it listens.
        Base = "base",
    }
}

choice! {
    /// Where the mapper runs.
    pub enum MapperHost ("\"robot\" or \"base\"") {
        /// Beside the odometry: the base sees its map.
        Robot = "robot",
        /// At the base: the robot gets its corrections.
        Base = "base",
    }
}

section! {
    /// What randt-link carries between a robot and a base, and how.
    pub struct Link {
        /// Which end this machine is.
        pub role: LinkRole = LinkRole::Robot,
        /// Name of the robot, at both ends the same: letters, digits, - and _. Its key has it, and
        /// at the base its pipeline (`--prefix`).
        pub robot: String = "robot".to_owned(),
        /// Address with port: of the base, which listens there. Each robot has a port of its own.
        /// Beyond this machine only with keys.
        pub address: String = "127.0.0.1:7447".to_owned(),
        /// Folder with this end's keys, which `randt-link keys` has made: authority.pem, own.pem,
        /// own.key. Empty: no encryption, and loopback alone.
        pub keys: String = String::new(),
        /// Names of robots that are refused, separated by blanks: lost ones, whose keys somebody
        /// else may have.
        pub refused: String = String::new(),
        /// Where the mapper runs.
        pub mapper: MapperHost = MapperHost::Robot,
        /// Topics that the base gets, separated by blanks. radar/scan/v1 needs ten times what all
        /// of these need.
        pub topics: String = "odometry/state/v1 stage/health/v1 mapper/correction/v1 mapper/graph/v1 odometry/keyframe/v1 mapper/grid/v1".to_owned(),
        /// Those of them of which every message is sent, also late; of the others only the newest.
        pub every: String = "odometry/keyframe/v1".to_owned(),
        /// Most that is sent in all, bytes a second; 0: as much as the link takes without a queue.
        pub rate_max: f64 = 0.0 => within(0.0, 1e9, "0 for no limit; more than any network has"),
        /// Most of single topics, such as "mapper/grid/v1=4000 odometry/keyframe/v1=30000", bytes
        /// a second.
        pub topic_rates: String = String::new(),
        /// Most of the robot's journal of keyframes in all its files, MB of 10^6 bytes; its oldest
        /// eighth goes when there is more. 12 kB a keyframe, 55 MB an hour in a building: half of
        /// what record.free_min_gb leaves on the disk. In the run folder, which is memory, 64 at
        /// most.
        pub journal_max_mb: f64 = 1000.0
            => within(1.0, 1e6, "some keyframes a file; a terabyte"),
    }
}
