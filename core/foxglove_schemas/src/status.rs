//! How fresh and how good what is shown is: as text beside the robot, and as a line of a log.

use crate::{BASE_LINK, MAP, pose_above, scene, timestamp};
use foxglove::messages::{Color, Log, SceneEntity, SceneUpdate, TextPrimitive, log};

/// Height of the letters, pixels.
const LETTERS: f64 = 14.0;
/// The text stands above the robot, m.
const ABOVE_M: f64 = 1.0;

/// How good it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusLevel {
    /// As it should be.
    Good,
    /// To be used with care.
    Doubtful,
    /// Not to be trusted.
    Bad,
}

/// The text at the robot, or at the map's origin while the robot's pose is unknown.
pub fn text(stamp_ns: i64, words: &str, level: StatusLevel, knows_robot: bool) -> SceneUpdate {
    let [r, g, b] = match level {
        StatusLevel::Good => [0.0, 0.6, 0.2],
        StatusLevel::Doubtful => [0.9, 0.55, 0.0],
        StatusLevel::Bad => [0.95, 0.0, 0.0],
    };
    scene::update(SceneEntity {
        timestamp: timestamp(stamp_ns),
        frame_id: if knows_robot { BASE_LINK } else { MAP }.to_owned(),
        id: "status".to_owned(),
        // It goes with the robot between two of them.
        frame_locked: true,
        texts: vec![TextPrimitive {
            pose: Some(pose_above([0.0; 3], ABOVE_M)),
            billboard: true,
            font_size: LETTERS,
            scale_invariant: true,
            color: Some(Color { r, g, b, a: 1.0 }),
            text: words.to_owned(),
        }],
        ..SceneEntity::default()
    })
}

/// The same for a log.
pub fn line(stamp_ns: i64, words: &str, level: StatusLevel) -> Log {
    let log_level = match level {
        StatusLevel::Good => log::Level::Info,
        StatusLevel::Doubtful => log::Level::Warning,
        StatusLevel::Bad => log::Level::Error,
    };
    Log {
        timestamp: timestamp(stamp_ns),
        level: log_level as i32,
        message: words.to_owned(),
        name: "randt-view".to_owned(),
        ..Log::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_news_are_red_and_errors() {
        let update = text(5, "pose 7 s old", StatusLevel::Bad, true);
        let entity = &update.entities[0];
        let colour = entity.texts[0].color.unwrap();
        assert!(colour.r > 0.9 && colour.g < 0.1 && colour.b < 0.1);
        assert_eq!(entity.frame_id, BASE_LINK);
        assert_eq!(
            line(5, "", StatusLevel::Bad).level,
            log::Level::Error as i32
        );
    }
}
