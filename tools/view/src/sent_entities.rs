//! Path and grid as a viewer has them: entities that it keeps, each of some version.

use crate::board::Entity;
use crate::{Board, Flow};
use randt_foxglove_schemas::{ViewerTopic, bytes, clear};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Below this rate tiles are shown without detail at first, bytes a second: a building takes 10 s
/// and more.
const SLOW: f64 = 100_000.0;
/// Below this rate no cells are shown: a submap's are up to 300 kB.
const CELLS_RATE_MIN: f64 = 250_000.0;
/// The version of an entity that was sent without its detail: no entity's.
const COARSE: u64 = 0;

/// The entities that one viewer has.
#[derive(Debug, Default)]
pub(crate) struct SentEntities {
    /// By channel: the map that its entities belong to.
    maps: BTreeMap<ViewerTopic, u64>,
    versions: BTreeMap<(ViewerTopic, String), u64>,
    /// The board's version at which nothing was missing.
    complete_version: u64,
}

impl SentEntities {
    /// The viewer has nothing of a channel any more.
    pub fn forget(&mut self, topic: ViewerTopic) {
        self.versions.retain(|(of, _), _| *of != topic);
        self.maps.remove(&topic);
        self.complete_version = 0;
    }

    /// What goes next, with its subscription: first the path, then the part of the grid that is
    /// nearest to the robot. On a slow link everything goes without detail first, then with it.
    /// `subscription`: that of a channel.
    pub fn next<'a>(
        &mut self,
        board: &'a Board,
        flow: &Flow,
        now_ns: i64,
        subscription: impl Fn(ViewerTopic) -> Option<u32>,
    ) -> Option<(u32, Cow<'a, [u8]>)> {
        for topic in [ViewerTopic::Path, ViewerTopic::Grid] {
            let Some(subscription) = subscription(topic) else {
                continue;
            };
            let had = self.maps.insert(topic, board.maps);
            if had == Some(board.maps) {
                continue;
            }
            self.versions.retain(|(of, _), _| *of != topic);
            if had.is_some() {
                // Another drive: the map before is void.
                let nothing = bytes(&clear(board.time_ns(now_ns)))?;
                return Some((subscription, Cow::Owned(nothing)));
            }
        }
        if self.complete_version == board.version {
            return None;
        }
        let is_slow = flow.rate() < SLOW;
        let wanted = board.entities.iter().filter(|(key, entity)| {
            let is_shown = key.0 != ViewerTopic::Cells || flow.rate() >= CELLS_RATE_MIN;
            let is_new = self.versions.get(*key) != Some(&entity.version);
            is_shown && is_new && subscription(key.0).is_some()
        });
        let next = wanted.min_by(|(key, entity), (other, than)| {
            let (known, far) = self.urgency(board, is_slow, key, entity);
            let (than_known, than) = self.urgency(board, is_slow, other, than);
            known.cmp(&than_known).then(far.total_cmp(&than))
        });
        let Some((key, entity)) = next else {
            self.complete_version = board.version;
            return None;
        };
        let coarse = entity.coarse.as_ref();
        let coarse = coarse.filter(|_| is_slow && !self.versions.contains_key(key));
        let payload = coarse.unwrap_or(&entity.bytes);
        if !flow.has_room(payload.len(), 0.0) {
            return None;
        }
        let version = match coarse {
            Some(_) => COARSE,
            None => entity.version,
        };
        self.versions.insert(key.clone(), version);
        Some((subscription(key.0)?, Cow::Borrowed(payload)))
    }

    /// The least goes first, and cells last: what has no position; then, on a slow link, what was
    /// not sent yet; then by the squared distance.
    fn urgency(
        &self,
        board: &Board,
        is_slow: bool,
        key: &(ViewerTopic, String),
        entity: &Entity,
    ) -> (bool, f64) {
        if key.0 == ViewerTopic::Cells {
            return (true, f64::INFINITY);
        }
        let Some([x_m, y_m]) = entity.position_m else {
            return (false, -1.0);
        };
        let [robot_x_m, robot_y_m] = board.robot_m();
        let (x_m, y_m) = (x_m - robot_x_m, y_m - robot_y_m);
        let is_known = is_slow && self.versions.contains_key(key);
        (is_known, x_m * x_m + y_m * y_m)
    }
}
