//! `SceneUpdate`: drawings, most of them of lines.

use crate::{pose_of, timestamp};
use foxglove::messages::line_primitive::Type;
use foxglove::messages::{
    Color, LinePrimitive, Point3, SceneEntity, SceneEntityDeletion, SceneUpdate,
    scene_entity_deletion,
};

/// Red, green, blue, alpha, from 0 to 1.
pub(crate) type Colour = [f64; 4];

/// Points are at whole numbers of this, m: digits that no viewer shows would double what a drawing
/// takes on the disk.
const GRAIN_M: f64 = 1.0 / 256.0;

/// Pairs of points, or a line through all of them; in metres, a few pixels thick at every zoom.
pub(crate) fn lines(kind: Type, points: Vec<Point3>, colour: Colour) -> LinePrimitive {
    /// In pixels.
    const THICKNESS: f64 = 2.0;
    LinePrimitive {
        r#type: kind as i32,
        pose: Some(pose_of([0.0; 3])),
        thickness: THICKNESS,
        scale_invariant: true,
        points,
        color: Some(color(colour)),
        ..LinePrimitive::default()
    }
}

/// A point of a drawing.
pub(crate) fn point([x_m, y_m]: [f64; 2]) -> Point3 {
    let coarse = |value_m: f64| (value_m / GRAIN_M).round() * GRAIN_M;
    Point3 {
        x: coarse(x_m),
        y: coarse(y_m),
        z: 0.0,
    }
}

pub(crate) const fn color([r, g, b, a]: Colour) -> Color {
    Color { r, g, b, a }
}

/// A drawing in a frame, with which it moves; it replaces the one that had this name on the topic.
pub(crate) fn drawing(
    frame: &str,
    name: &str,
    stamp_ns: i64,
    lines: Vec<LinePrimitive>,
) -> SceneUpdate {
    let entity = SceneEntity {
        timestamp: timestamp(stamp_ns),
        frame_id: frame.to_owned(),
        id: name.to_owned(),
        frame_locked: true,
        lines,
        ..SceneEntity::default()
    };
    update(entity)
}

/// An update with one entity.
pub(crate) fn update(entity: SceneEntity) -> SceneUpdate {
    SceneUpdate {
        deletions: Vec::new(),
        entities: vec![entity],
    }
}

/// An update by which a viewer forgets all that this channel has drawn.
pub fn clear(stamp_ns: i64) -> SceneUpdate {
    let all = SceneEntityDeletion {
        timestamp: timestamp(stamp_ns),
        r#type: scene_entity_deletion::Type::All as i32,
        id: String::new(),
    };
    SceneUpdate {
        deletions: vec![all],
        entities: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_is_one_entity_that_moves_with_its_frame() {
        let points = vec![point([1.001, 0.0]), point([0.0, -2.0])];
        let line = lines(Type::LineStrip, points, [1.0, 0.5, 0.0, 1.0]);
        assert_eq!(line.points[0].x, 1.0);
        assert_eq!(line.points[1].y, -2.0);
        let update = drawing("map", "graph", 5, vec![line]);
        let [entity] = update.entities.as_slice() else {
            panic!("{update:?}");
        };
        assert_eq!(
            (entity.frame_id.as_str(), entity.id.as_str()),
            ("map", "graph")
        );
        assert!(entity.frame_locked && entity.lifetime.is_none());
        assert_eq!(entity.timestamp.unwrap().nsec(), 5);
    }
}
