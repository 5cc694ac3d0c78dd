//! Which keyframe comes next: each once, in order, of one drive, none missing.

/// This many requests for missing keyframes are answered by later ones before the map goes on
/// without them.
pub const REFUSALS_MAX: u32 = 6;

/// What becomes of a keyframe that came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admission {
    /// It is the next one.
    Taken,
    /// It is a double, another drive's, or ahead of keyframes that were asked for already.
    Dropped,
    /// It is ahead: the missing ones are to be asked for at once.
    Missing,
}

/// The numbers that were taken, and what is known of odometry by them.
pub struct KeyframeSequence {
    /// The keyframe that is waited for.
    pub next: u64,
    /// Whether keyframes shall be sent again, whether that was asked for since the last answer,
    /// and how often the answer was a later keyframe. Silence is no answer: odometry may be away
    /// itself.
    is_missing: bool,
    is_asked: bool,
    refusals: u32,
    /// Keyframes that never came.
    pub lost: u64,
    /// Whether odometry numbers the drive that the map is of: it has shown that it knows the map's
    /// last keyframe. Before that a keyframe of the right number may be another drive's.
    is_of_this_drive: bool,
    /// Whether a keyframe came that has the number of one of the map's and is another one, or
    /// odometry goes on in the map's frame without having its last one.
    pub is_other_drive: bool,
}

impl KeyframeSequence {
    /// Goes on after the keyframes of a journal. What came while no mapper was here is in
    /// odometry's ring.
    pub fn after(next: u64) -> Self {
        Self {
            next,
            is_missing: true,
            is_asked: false,
            refusals: 0,
            lost: 0,
            is_of_this_drive: next == 0,
            is_other_drive: false,
        }
    }

    /// Judges a keyframe that came. A new frame stands by itself, whichever drive it is numbered
    /// in.
    pub fn admit(
        &mut self,
        id: u64,
        is_new_frame: bool,
        is_double: impl FnOnce() -> bool,
    ) -> Admission {
        if self.is_other_drive {
            return Admission::Dropped;
        }
        if id < self.next {
            let is_double = is_double();
            self.is_other_drive = !is_double;
            self.is_of_this_drive |= is_double && id + 1 == self.next;
            return Admission::Dropped;
        }
        if id > self.next || !(self.is_of_this_drive || is_new_frame) {
            let is_news = !self.is_missing;
            self.refusals += u32::from(std::mem::take(&mut self.is_asked));
            if self.refusals < REFUSALS_MAX {
                self.is_missing = true;
                return match is_news {
                    true => Admission::Missing,
                    false => Admission::Dropped,
                };
            }
            if id == self.next {
                // None is missing, and yet odometry does not know the one before.
                self.is_other_drive = true;
                return Admission::Dropped;
            }
            // Odometry has them no more: a map with a gap is better than none.
            self.lost += id - self.next;
        }
        (self.next, self.is_missing, self.refusals) = (id + 1, false, 0);
        self.is_of_this_drive = true;
        Admission::Taken
    }

    /// Whether keyframes shall be sent again; the caller asks odometry for them.
    pub fn request(&mut self) -> bool {
        self.is_asked = self.is_missing;
        self.is_missing
    }
}
