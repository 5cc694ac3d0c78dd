//! The odometry frame in force.

use randt_geometry::Pose2;
use randt_persist::persist;

/// A frame in which poses are continuous; two are never spliced.
#[derive(Clone, Copy, Debug, Default)]
pub struct OdometryFrame {
    /// Number of the frame, from 0.
    pub id: u64,
    /// Whether the pose was lost, so that the next scan opens a new frame.
    pub is_lost: bool,
    /// Whether a scan saw enough to be set against the first one: before, there is no pose that
    /// could be lost.
    pub has_begun: bool,
    /// Whether a scan was not enough for a first one.
    pub has_waited: bool,
    /// End of the last such scan, ns: the heading goes on from there.
    pub waits_since_ns: Option<i64>,
    /// Pose of its first scan in `odom`.
    pub odom_from_first: Pose2,
}

persist!(OdometryFrame {
    id,
    is_lost,
    has_begun,
    has_waited,
    waits_since_ns,
    odom_from_first,
} sound has_room);

impl OdometryFrame {
    /// A frame after others that begins at a known pose.
    pub fn after(last_id: u64, odom_from_first: Pose2) -> Self {
        Self {
            id: last_id + 1,
            odom_from_first,
            ..Self::default()
        }
    }

    /// Whether it waits for its first scan: its poses are none.
    pub fn is_waiting(&self) -> bool {
        self.has_waited && !self.has_begun
    }

    /// Whether there are numbers left.
    fn has_room(&self) -> bool {
        self.id <= u64::MAX / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_persist::{Persist, Reader, Writer};

    #[test]
    fn it_survives_its_process_unless_there_are_no_numbers_left() {
        let frame = OdometryFrame::after(6, Pose2::new(1.0, 2.0, 3.0));
        let mut bytes = [0; 64];
        frame.save(&mut Writer::new(&mut bytes));
        let mut restored = OdometryFrame::default();
        restored.restore(&mut Reader::new(&bytes)).unwrap();
        assert_eq!((restored.id, restored.is_lost), (7, false));
        assert_eq!(restored.odom_from_first, frame.odom_from_first);
        bytes[..8].fill(0xff);
        assert!(restored.restore(&mut Reader::new(&bytes)).is_err());
    }
}
