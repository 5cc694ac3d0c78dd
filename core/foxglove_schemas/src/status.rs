//! How fresh and how good what is shown is: as text beside the robot, and as a line of a log.

use crate::{BASE_LINK, MAP, pose_above, scene, timestamp};
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{Log, SceneEntity, SceneUpdate, TextPrimitive, log};
use randt_geometry::elementary::sin_cos;
use randt_messages::OdometryState;

/// Height of the letters, pixels.
const LETTERS: f64 = 14.0;
/// The text stands above the robot, m.
const ABOVE_M: f64 = 1.0;
/// How far the line along the direction that is not seen goes to both sides, m.
const WEAK_M: f64 = 5.0;

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

/// The text at the robot, with a line along the direction that it does not see; at the map's
/// origin while the robot's pose is unknown.
pub fn text(
    stamp_ns: i64,
    words: &str,
    level: StatusLevel,
    state: Option<&OdometryState>,
) -> SceneUpdate {
    let [r, g, b] = match level {
        StatusLevel::Good => [0.0, 0.6, 0.2],
        StatusLevel::Doubtful => [0.9, 0.55, 0.0],
        StatusLevel::Bad => [0.95, 0.0, 0.0],
    };
    let colour = [r, g, b, 1.0];
    let weak = state.and_then(OdometryState::weak_direction);
    let lines = weak.map(|direction_rad| {
        let (sine, cosine) = sin_cos(direction_rad);
        let end = |to_m: f64| scene::point([to_m * cosine, to_m * sine]);
        scene::lines(Type::LineStrip, vec![end(-WEAK_M), end(WEAK_M)], colour)
    });
    scene::update(SceneEntity {
        timestamp: timestamp(stamp_ns),
        frame_id: if state.is_some() { BASE_LINK } else { MAP }.to_owned(),
        id: "status".to_owned(),
        // It goes with the robot between two of them.
        frame_locked: true,
        texts: vec![TextPrimitive {
            pose: Some(pose_above([0.0; 3], ABOVE_M)),
            billboard: true,
            font_size: LETTERS,
            scale_invariant: true,
            color: Some(scene::color(colour)),
            text: words.to_owned(),
        }],
        lines: lines.into_iter().collect(),
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
    use randt_messages::Localizability;

    #[test]
    fn bad_news_are_red_and_errors() {
        let mut state = OdometryState::default();
        let update = text(5, "pose 7 s old", StatusLevel::Bad, Some(&state));
        let entity = &update.entities[0];
        let colour = entity.texts[0].color.unwrap();
        assert!(colour.r > 0.9 && colour.g < 0.1 && colour.b < 0.1);
        assert_eq!(
            (entity.frame_id.as_str(), entity.lines.len()),
            (BASE_LINK, 0)
        );
        let unknown = text(5, "no pose yet", StatusLevel::Bad, None);
        assert_eq!(unknown.entities[0].frame_id, MAP);
        state.localizability = Localizability::Partial as u32;
        state.weak_direction_rad = std::f64::consts::FRAC_PI_2;
        let update = text(5, "trust degraded", StatusLevel::Doubtful, Some(&state));
        let ends = &update.entities[0].lines[0].points;
        let ends: Vec<_> = ends.iter().map(|end| (end.x, end.y)).collect();
        assert_eq!(ends, [(0.0, -5.0), (0.0, 5.0)]);
        assert_eq!(
            line(5, "", StatusLevel::Bad).level,
            log::Level::Error as i32
        );
    }
}
