//! What the view reads of the bus.

use randt_messages::{
    Keyframe, MapperCorrection, MapperGraph, MapperGrid, OdometryStateTopic, RadarPoints,
};
use randt_stage::{Error, Stage, Subscriber, Waitable};
use randt_view::Board;

/// The topics that are shown.
pub struct Inputs {
    states: Subscriber<OdometryStateTopic>,
    points: Subscriber<RadarPoints>,
    corrections: Subscriber<MapperCorrection>,
    graphs: Subscriber<MapperGraph>,
    tiles: Subscriber<MapperGrid>,
    keyframes: Subscriber<Keyframe>,
}

impl Inputs {
    /// Begins to read them.
    pub fn open(stage: &mut Stage) -> Result<Self, Error> {
        Ok(Self {
            states: stage.subscriber()?,
            points: stage.subscriber()?,
            corrections: stage.subscriber()?,
            graphs: stage.subscriber()?,
            tiles: stage.subscriber()?,
            keyframes: stage.subscriber()?,
        })
    }

    /// Takes what has come.
    pub fn drain(&mut self, board: &mut Board) -> Result<(), Error> {
        while let Some(state) = self.states.receive()? {
            board.take_state(state.message().head);
        }
        while let Some(points) = self.points.receive()? {
            board.take_points(points.message());
        }
        // Before the map: a correction shows whether that is another one.
        while let Some(correction) = self.corrections.receive()? {
            board.take_correction(correction.message().head);
        }
        while let Some(page) = self.graphs.receive()? {
            board.take_graph(page.message());
        }
        while let Some(tile) = self.tiles.receive()? {
            board.take_tile(tile.message());
        }
        while let Some(keyframe) = self.keyframes.receive()? {
            board.take_keyframe(keyframe.message());
        }
        Ok(())
    }

    /// What to sleep on.
    pub fn waitables(&self) -> Vec<&dyn Waitable> {
        vec![
            &self.states,
            &self.points,
            &self.corrections,
            &self.graphs,
            &self.tiles,
            &self.keyframes,
        ]
    }
}
