//! The map on its way to those who read it: at once what is small, paced what is large.

use super::Intake;
use randt_mapper::grid::TileIndex;
use randt_mapper::publication::{correction, fill_graph, fill_tile, list_tiles};
use randt_messages::{MapperCorrection, MapperGraph, MapperGrid, Message, MessageRef};
use randt_stage::{Error, Publisher, Stage};
use std::time::{Duration, Instant};

/// What the mapper has and wants is told so often, whether it changed or not.
const BEAT: Duration = Duration::from_millis(500);
/// The whole graph and the grid follow the map at this distance: painting anew after a loop takes 40 ms.
const PAINT: Duration = Duration::from_secs(2);
/// Keyframes that are painted for the first time before it looks at what has come: a map that has come back has
/// thousands, at a tenth of a millisecond each.
const PAINTED_MAX: usize = 500;
/// Tiles that are sent at once; the buffer holds 64.
const TILES: usize = 16;

/// The topics that the mapper writes.
pub struct Outlet {
    corrections: Publisher<MapperCorrection>,
    graphs: Publisher<MapperGraph>,
    grids: Publisher<MapperGrid>,
    graph: Message<MapperGraph>,
    tile: Message<MapperGrid>,
    has_told: bool,
    /// Versions of the map that were told.
    corrected: Option<u64>,
    drawn: Option<u64>,
    /// Tiles that are to be sent, the next one last, and the version of the grid that they lead to.
    tiles: Vec<TileIndex>,
    listed: u64,
    beat: Instant,
    paint: Instant,
    /// Whether keyframes are left to be painted before the map can be drawn.
    is_painting: bool,
}

impl Outlet {
    /// Opens the topics.
    pub fn open(stage: &mut Stage) -> Result<Self, Error> {
        Ok(Self {
            corrections: stage.publisher()?,
            graphs: stage.publisher()?,
            grids: stage.publisher()?,
            graph: Message::default(),
            tile: Message::default(),
            has_told: false,
            corrected: None,
            drawn: None,
            tiles: Vec::new(),
            listed: 0,
            beat: Instant::now(),
            paint: Instant::now(),
            is_painting: false,
        })
    }

    /// Tells what is due. `at_once`: what the mapper has or wants has changed.
    pub fn tell(&mut self, intake: &mut Intake, at_once: bool) -> Result<(), Error> {
        let now = Instant::now();
        let version = intake.mapper().version();
        // A map that takes keyframes anew would have the pose jump to where it was long ago.
        let is_whole = !intake.is_behind();
        let is_first = !std::mem::replace(&mut self.has_told, true) && intake.is_as_told();
        if (is_whole || is_first)
            && self.corrected != Some(version)
            && let Some(head) = correction(intake.mapper())
        {
            let items = &[];
            self.corrections
                .publish(MessageRef { head: &head, items })?;
            self.corrected = Some(version);
        }
        if at_once || now >= self.beat {
            self.beat = now + BEAT;
            fill_graph(intake.mapper(), 0, &mut self.graph);
            self.graph.items.clear();
            self.send_graph(intake, true)?;
        }
        if self.grids.has_new_reader() {
            // The history holds 8 messages: a map has hundreds of tiles, and they seldom change once they are known.
            self.begin_anew();
        }
        // What is listed goes out first, so that a map that keeps changing reaches its readers whole all the same.
        let is_news = self.drawn != Some(version) && self.tiles.is_empty();
        if is_whole && is_news && now >= self.paint {
            self.is_painting = intake.mapper().update_grid_by(PAINTED_MAX).added == PAINTED_MAX;
            if !self.is_painting {
                self.paint = now + PAINT;
                self.drawn = Some(version);
                self.draw(intake)?;
            }
        }
        self.send_tiles(intake)
    }

    /// The whole map is to be told, be it that it is another one.
    pub fn begin_anew(&mut self) {
        self.is_painting = false;
        (self.paint, self.drawn, self.listed) = (Instant::now(), None, 0);
        self.tiles.clear();
    }

    /// Sends the whole graph, page by page, and lists the tiles that have changed.
    fn draw(&mut self, intake: &mut Intake) -> Result<(), Error> {
        let mut entry = Some(0);
        while let Some(first) = entry {
            entry = fill_graph(intake.mapper(), first, &mut self.graph);
            self.send_graph(intake, false)?;
        }
        self.listed = list_tiles(intake.mapper(), self.listed, &mut self.tiles);
        self.tiles.reverse();
        Ok(())
    }

    fn send_graph(&mut self, intake: &mut Intake, may_ask: bool) -> Result<(), Error> {
        let head = &mut *self.graph.head;
        // Who begins to number numbers on after the journal, not after what the map has of it by now.
        head.wanted_keyframe = intake.next();
        head.odom_frame_id = intake.newest_frame().unwrap_or(0);
        head.on_disk = intake.on_disk();
        head.send_again = u32::from(may_ask && intake.request());
        self.graphs.publish(self.graph.as_ref())
    }

    fn send_tiles(&mut self, intake: &mut Intake) -> Result<(), Error> {
        for _ in 0..TILES {
            let Some(index) = self.tiles.pop() else {
                return Ok(());
            };
            fill_tile(intake.mapper(), index, &mut self.tile);
            self.grids.publish(self.tile.as_ref())?;
        }
        Ok(())
    }

    /// How long to sleep at most.
    pub fn pause(&self) -> Duration {
        if self.is_painting {
            return Duration::ZERO;
        }
        // Tiles that are left go out ten times a second.
        let pace = if self.tiles.is_empty() {
            BEAT
        } else {
            BEAT / 5
        };
        self.beat
            .saturating_duration_since(Instant::now())
            .min(pace)
    }
}
