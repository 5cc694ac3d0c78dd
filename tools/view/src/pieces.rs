//! Path and grid as a viewer has them: pieces that it keeps, each of some version.

use crate::board::Piece;
use crate::{Board, Flow, Shown};
use randt_foxglove_schemas::{bytes, clear};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Below this rate tiles are shown without detail at first, bytes a second: a building takes 10 s and more.
const SLOW: f64 = 100_000.0;
/// The version of a piece that is there without its detail: no piece's.
const COARSE: u64 = 0;

/// The pieces that one viewer has.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    /// By channel: the map that its pieces belong to.
    maps: BTreeMap<Shown, u64>,
    versions: BTreeMap<(Shown, String), u64>,
    /// No piece is newer than this, as far as was looked.
    looked: u64,
}

impl Pieces {
    /// The viewer has nothing of a channel any more.
    pub fn forget(&mut self, shown: Shown) {
        self.versions.retain(|(of, _), _| *of != shown);
        self.maps.remove(&shown);
        self.looked = 0;
    }

    /// What goes next, with its subscription: of the path first, then of the grid what is nearest to the robot. On a slow
    /// link all of it without detail, then with it: never the other way round. `subscription`: that of a channel.
    pub fn next<'a>(
        &mut self,
        board: &'a Board,
        flow: &Flow,
        now_ns: i64,
        subscription: impl Fn(Shown) -> Option<u32>,
    ) -> Option<(u32, Cow<'a, [u8]>)> {
        for shown in [Shown::Path, Shown::Grid] {
            let Some(subscription) = subscription(shown) else {
                continue;
            };
            let had = self.maps.insert(shown, board.maps);
            if had == Some(board.maps) {
                continue;
            }
            self.versions.retain(|(of, _), _| *of != shown);
            if had.is_some() {
                // Another drive: nothing of the map before holds any more.
                let nothing = bytes(&clear(board.time_ns(now_ns)))?;
                return Some((subscription, Cow::Owned(nothing)));
            }
        }
        if self.looked == board.version {
            return None;
        }
        let is_slow = flow.rate() < SLOW;
        let wanted = board.pieces.iter().filter(|(key, piece)| {
            subscription(key.0).is_some() && self.versions.get(*key) != Some(&piece.version)
        });
        let next = wanted.min_by(|(key, piece), (other, than)| {
            let (known, far) = self.urgency(board, is_slow, key, piece);
            let (than_known, than) = self.urgency(board, is_slow, other, than);
            known.cmp(&than_known).then(far.total_cmp(&than))
        });
        let Some((key, piece)) = next else {
            self.looked = board.version;
            return None;
        };
        let coarse = piece.coarse.as_ref();
        let coarse = coarse.filter(|_| is_slow && !self.versions.contains_key(key));
        let payload = coarse.unwrap_or(&piece.bytes);
        if !flow.has_room(payload.len(), 0.0) {
            return None;
        }
        let version = match coarse {
            Some(_) => COARSE,
            None => piece.version,
        };
        self.versions.insert(key.clone(), version);
        Some((subscription(key.0)?, Cow::Borrowed(payload)))
    }

    /// The least goes first: what lies nowhere; then, on a slow link, what there is nothing of yet; then by the squared
    /// distance.
    fn urgency(
        &self,
        board: &Board,
        is_slow: bool,
        key: &(Shown, String),
        piece: &Piece,
    ) -> (bool, f64) {
        let Some([x_m, y_m]) = piece.place_m else {
            return (false, -1.0);
        };
        let [robot_x_m, robot_y_m] = board.robot_m();
        let (x_m, y_m) = (x_m - robot_x_m, y_m - robot_y_m);
        let is_known = is_slow && self.versions.contains_key(key);
        (is_known, x_m * x_m + y_m * y_m)
    }
}
