//! The map on its way to its readers: at once what is small, paced what is large.

use super::KeyframeIngest;
use randt_mapper::Mapper;
use randt_mapper::occupancy::TileIndex;
use randt_mapper::publication::{correction, fill_graph, fill_tile, list_tiles};
use randt_messages::{MapperCorrection, MapperGraph, MapperGrid, Message, MessageRef};
use randt_stage::{Error, Publisher, Stage};
use std::time::{Duration, Instant};

/// What the mapper has and wants is published this often, whether it changed or not.
const BEAT: Duration = Duration::from_millis(500);
/// The whole graph and the grid follow the map at this distance: painting anew after a loop takes
/// 40 ms.
const PAINT: Duration = Duration::from_secs(2);
/// Paintings of keyframes before it polls for what has come, at a tenth of a millisecond each: a
/// map that has come back has thousands, and so has one that a loop has moved.
const PAINTINGS_MAX: usize = 200;
/// Tiles that are sent at once; the buffer holds 64.
const TILES: usize = 16;

/// The topics that the mapper writes.
pub struct MapPublisher {
    corrections: Publisher<MapperCorrection>,
    graphs: Publisher<MapperGraph>,
    graph: Message<MapperGraph>,
    tiles: TileQueue,
    has_published: bool,
    /// Versions of the map that were published.
    corrected: Option<u64>,
    drawn: Option<u64>,
    beat: Instant,
    paint: Instant,
    /// Whether keyframes are left to be painted before the map can be drawn.
    is_painting: bool,
}

impl MapPublisher {
    /// Opens the topics.
    pub fn open(stage: &mut Stage) -> Result<Self, Error> {
        Ok(Self {
            corrections: stage.publisher()?,
            graphs: stage.publisher()?,
            graph: Message::default(),
            tiles: TileQueue {
                publisher: stage.publisher()?,
                tile: Message::default(),
                tiles: Vec::new(),
                listed: 0,
            },
            has_published: false,
            corrected: None,
            drawn: None,
            beat: Instant::now(),
            paint: Instant::now(),
            is_painting: false,
        })
    }

    /// Publishes what is due. `at_once`: what the mapper has or wants has changed.
    pub fn publish(&mut self, ingest: &mut KeyframeIngest, at_once: bool) -> Result<(), Error> {
        let now = Instant::now();
        let version = ingest.mapper.version();
        // A map that takes keyframes anew would have the pose jump to where it was long ago.
        let is_whole = !ingest.is_behind();
        let is_first =
            !std::mem::replace(&mut self.has_published, true) && ingest.is_as_published();
        if (is_whole || is_first)
            && self.corrected != Some(version)
            && let Some(head) = correction(&ingest.mapper)
        {
            let items = &[];
            self.corrections
                .publish(MessageRef { head: &head, items })?;
            self.corrected = Some(version);
        }
        if at_once || now >= self.beat {
            self.beat = now + BEAT;
            fill_graph(&ingest.mapper, 0, &mut self.graph);
            self.graph.items.clear();
            self.send_graph(ingest, true)?;
        }
        if self.tiles.publisher.has_new_reader() {
            // The history holds 8 messages: a map has hundreds of tiles, and they seldom change
            // once they are known.
            self.begin_anew();
        }
        // What is listed goes out first, so that a map that keeps changing reaches its readers
        // whole all the same.
        let is_news = self.drawn != Some(version) && self.tiles.is_empty();
        if is_whole && is_news && now >= self.paint {
            self.is_painting = ingest.mapper.update_grid_by(PAINTINGS_MAX).left > 0;
            if !self.is_painting {
                self.paint = now + PAINT;
                self.drawn = Some(version);
                self.draw(ingest)?;
            }
        }
        self.tiles.publish(&ingest.mapper)
    }

    /// The whole map is to be published, also where it is another one.
    pub fn begin_anew(&mut self) {
        self.is_painting = false;
        (self.paint, self.drawn) = (Instant::now(), None);
        self.tiles.clear();
    }

    /// Sends the whole graph, page by page, and lists the tiles that have changed.
    fn draw(&mut self, ingest: &mut KeyframeIngest) -> Result<(), Error> {
        let mut entry = Some(0);
        while let Some(first) = entry {
            entry = fill_graph(&ingest.mapper, first, &mut self.graph);
            self.send_graph(ingest, false)?;
        }
        self.tiles.list(&ingest.mapper);
        Ok(())
    }

    fn send_graph(&mut self, ingest: &mut KeyframeIngest, may_ask: bool) -> Result<(), Error> {
        let head = &mut *self.graph.head;
        // Odometry that begins to number goes on after the journal, not after what the map has of
        // it by now.
        head.wanted_keyframe = ingest.sequence.next;
        head.odom_frame_id = ingest.newest_frame().unwrap_or(0);
        head.on_disk = ingest.writer.journal.on_disk();
        head.send_again = u32::from(may_ask && ingest.sequence.request());
        self.graphs.publish(self.graph.as_ref())
    }

    /// How long to sleep at most.
    pub fn pause(&self) -> Duration {
        if self.is_painting {
            return Duration::ZERO;
        }
        // Tiles that are left go out ten times a second.
        let pace = match self.tiles.is_empty() {
            true => BEAT,
            false => BEAT / 5,
        };
        let left = self.beat.saturating_duration_since(Instant::now());
        left.min(pace)
    }
}

/// Tiles of the grid that changed, published some at a time.
struct TileQueue {
    publisher: Publisher<MapperGrid>,
    tile: Message<MapperGrid>,
    /// Tiles that are to be sent, the next one last, and the version of the grid that they lead
    /// to.
    tiles: Vec<TileIndex>,
    listed: u64,
}

impl TileQueue {
    fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }

    /// Forgets what was sent: all tiles are listed next.
    fn clear(&mut self) {
        self.tiles.clear();
        self.listed = 0;
    }

    /// Lists the tiles that have changed.
    fn list(&mut self, mapper: &Mapper) {
        self.listed = list_tiles(mapper, self.listed, &mut self.tiles);
        self.tiles.reverse();
    }

    fn publish(&mut self, mapper: &Mapper) -> Result<(), Error> {
        for _ in 0..TILES {
            let Some(index) = self.tiles.pop() else { break };
            fill_tile(mapper, index, &mut self.tile);
            self.publisher.publish(self.tile.as_ref())?;
        }
        Ok(())
    }
}
