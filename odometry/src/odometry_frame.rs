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
    /// Pose of its first scan in `odom`.
    pub odom_from_first: Pose2,
}

persist!(OdometryFrame { id, is_lost, odom_from_first } sound has_room);

impl OdometryFrame {
    /// A frame after others that begins at a known pose.
    pub fn after(last_id: u64, odom_from_first: Pose2) -> Self {
        Self {
            id: last_id + 1,
            is_lost: false,
            odom_from_first,
        }
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
