//! Standstill from an IMU alone, and the gyro bias that it shows.
//!
//! Responsible for deciding, sample by sample and without looking ahead, when the robot stands.
//! Not responsible for the bias as a whole: every measurement is given out once, and the owner of
//! the bias fuses it.

use crate::clock::{Pace, SampleClock};
use crate::statistics::Statistics;
use nalgebra::Vector3;
use randt_persist::persist;

/// Blocks in a window. Finer ones find the ends of a standstill better, coarser ones cost less.
const BLOCKS: usize = 20;

/// Blocks next to motion that are not used for the bias: a fifth of the window, because a window
/// that is still as a whole may end in the first jerk of a departure or begin in the last swing of
/// a stop.
const GUARD: usize = BLOCKS / 5;

/// Fewest samples in a window; with fewer the spread is not significant.
const SAMPLES_MIN: f64 = 20.0;

/// What no average of a MEMS gyro goes below within a minute (bias instability, 20 deg/h), rad/s.
const INSTABILITY_RAD_S: f64 = 1e-4;

/// A bias seen while the robot stood. Its samples are in no other measurement: they may be fused
/// as independent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandstillBias {
    /// First instant of the samples.
    pub begin_ns: i64,
    /// Last instant of the samples.
    pub end_ns: i64,
    /// Mean rate about the body's axes, which is the bias.
    pub bias_rad_s: Vector3<f64>,
    /// Its standard deviation, axis by axis.
    pub sigma_rad_s: Vector3<f64>,
    /// Mean specific force in the body, m/s^2: gravity alone.
    pub gravity_m_s2: Vector3<f64>,
    /// Standard deviation of the specific force, root of the axes' sum, m/s^2: noise, and the
    /// vibration of a robot that drives slowly and evenly after all.
    pub spread_m_s2: f64,
}

/// Finds standstill in a window that slides block by block, at any sampling rate, in fixed memory.
///
/// A window is still where rate and specific force hardly vary, the mean rate of its halves
/// agrees, and it lies within what a bias can be: around zero at first, around the owner's
/// estimate after [`Self::expect_bias`]. The last one keeps a slow and even turn from passing for
/// a bias. Its fields are limits, the running sums of a block and the blocks of the window.
#[derive(Clone, Debug)]
pub struct Standstill {
    block_ns: i64,
    rate_max_rad_s: f64,
    acceleration_max_m_s2: f64,
    bias_max_rad_s: f64,
    bias_change_max_rad_s: f64,
    expected: Option<(Vector3<f64>, f64)>,
    clock: SampleClock,
    last_ns: i64,
    block: Block,
    /// The last blocks, oldest first from `next` on; `filled` of them count.
    ring: [Block; BLOCKS],
    next: usize,
    filled: usize,
    still_since_ns: Option<i64>,
    /// What this standstill has shown and was not given out.
    pending: Pending,
    /// Last instant that was given out.
    given_ns: Option<i64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Block {
    begin_ns: i64,
    end_ns: i64,
    rate: Statistics,
    acceleration: Statistics,
}

#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    samples: Block,
    /// Of the blocks' mean rates: shows slow noise that a count of samples would not.
    means: Statistics,
}

persist!(Block {
    begin_ns,
    end_ns,
    rate,
    acceleration
});
persist!(Pending { samples, means });
persist!(Standstill {
    expected,
    clock,
    last_ns,
    block,
    ring,
    next,
    filled,
    still_since_ns,
    pending,
    given_ns,
} kept {
    block_ns,
    rate_max_rad_s,
    acceleration_max_m_s2,
    bias_max_rad_s,
    bias_change_max_rad_s,
} sound is_sound);

impl Standstill {
    fn is_sound(&self) -> bool {
        self.next < BLOCKS && self.filled <= BLOCKS
    }

    /// A detector that has seen nothing.
    pub fn new(attitude: &randt_config::Attitude) -> Self {
        Self {
            block_ns: ((attitude.standstill_window_s * 1e9) as i64 / BLOCKS as i64).max(1),
            rate_max_rad_s: attitude.standstill_rate_rad_s,
            acceleration_max_m_s2: attitude.standstill_acceleration_m_s2,
            bias_max_rad_s: attitude.standstill_bias_max_rad_s,
            bias_change_max_rad_s: attitude.standstill_bias_change_rad_s,
            expected: None,
            clock: SampleClock::default(),
            last_ns: 0,
            block: Block::default(),
            ring: [Block::default(); BLOCKS],
            next: 0,
            filled: 0,
            still_since_ns: None,
            pending: Pending::default(),
            given_ns: None,
        }
    }

    /// The owner's estimate of the bias with its standard deviation, rad/s: standstills must show
    /// it again. The deviation should grow with time, or a bias that drifted away would never be
    /// believed.
    pub fn expect_bias(&mut self, bias_rad_s: Vector3<f64>, sigma_rad_s: Vector3<f64>) {
        self.expected = Some((bias_rad_s, sigma_rad_s.norm()));
    }

    /// Takes one sample: angular rate, rad/s, bias included, and specific force, m/s^2, in the
    /// body. Gives a measurement of the bias about once in half a window of standstill.
    pub fn push(
        &mut self,
        stamp_ns: i64,
        rate_rad_s: Vector3<f64>,
        acceleration_m_s2: Vector3<f64>,
    ) -> Option<StandstillBias> {
        let pace = self.clock.step(stamp_ns, &rate_rad_s, &acceleration_m_s2);
        if pace == Pace::Ignored {
            return None;
        }
        let gap_ns = stamp_ns.saturating_sub(self.last_ns);
        let measurement = if pace == Pace::Start || gap_ns > self.window_ns() {
            self.moved();
            self.given_ns = None;
            self.filled = 0;
            self.block = Block::at(stamp_ns);
            None
        } else if stamp_ns.saturating_sub(self.block.begin_ns) >= self.block_ns {
            let full = core::mem::replace(&mut self.block, Block::at(stamp_ns));
            self.take(full)
        } else {
            None
        };
        self.last_ns = stamp_ns;
        self.block.push(stamp_ns, rate_rad_s, acceleration_m_s2);
        measurement
    }

    /// The first instant of the standstill that lasts, where the window up to now is still.
    pub fn still_since_ns(&self) -> Option<i64> {
        self.still_since_ns
    }

    /// The last instant that the window reaches: the end of the last whole block.
    pub fn decided_ns(&self) -> i64 {
        self.newest(0).map_or(self.block.begin_ns, |b| b.end_ns)
    }

    fn window_ns(&self) -> i64 {
        self.block_ns.saturating_mul(BLOCKS as i64)
    }

    /// Adds a whole block and judges the window anew.
    fn take(&mut self, block: Block) -> Option<StandstillBias> {
        if let Some(oldest) = self.ring.get_mut(self.next) {
            *oldest = block;
        }
        self.next = (self.next + 1) % BLOCKS;
        self.filled = (self.filled + 1).min(BLOCKS);
        if !self.window_is_still() {
            self.moved();
            return None;
        }
        if self.still_since_ns.is_none() {
            self.still_since_ns = self.newest(BLOCKS - 1).map(|b| b.begin_ns);
            for age in (GUARD + 1..BLOCKS - GUARD).rev() {
                self.pend(age);
            }
        }
        self.pend(GUARD);
        self.take_pending()
    }

    /// Adds a block to what is not given out, unless an earlier standstill gave it out already.
    fn pend(&mut self, age: usize) {
        let given_ns = self.given_ns;
        let fresh = |block: &&Block| given_ns.is_none_or(|given_ns| block.begin_ns > given_ns);
        if let Some(block) = self.newest(age).filter(fresh).copied() {
            self.pending.samples.merge(&block);
            self.pending.means.push(block.rate.mean);
        }
    }

    /// The measurement, where enough has come together.
    fn take_pending(&mut self) -> Option<StandstillBias> {
        let Pending { samples, means } = self.pending;
        if means.count < (BLOCKS / 2) as f64 {
            return None;
        }
        self.pending = Pending::default();
        self.given_ns = Some(samples.end_ns);
        let floor = INSTABILITY_RAD_S * INSTABILITY_RAD_S;
        Some(StandstillBias {
            begin_ns: samples.begin_ns,
            end_ns: samples.end_ns,
            bias_rad_s: samples.rate.mean,
            sigma_rad_s: (means.variance() / means.count).map(|v| (v + floor).sqrt()),
            gravity_m_s2: samples.acceleration.mean,
            spread_m_s2: samples.acceleration.deviation(),
        })
    }

    fn moved(&mut self) {
        self.still_since_ns = None;
        self.pending = Pending::default();
    }

    /// A block of the window, 0 the newest.
    fn newest(&self, age: usize) -> Option<&Block> {
        if age >= self.filled {
            return None;
        }
        self.ring.get((self.next + BLOCKS - 1 - age) % BLOCKS)
    }

    fn merged(&self, ages: core::ops::Range<usize>) -> Block {
        let mut all = Block::default();
        for block in ages.rev().filter_map(|age| self.newest(age)) {
            all.merge(block);
        }
        all
    }

    fn window_is_still(&self) -> bool {
        if self.filled < BLOCKS {
            return false;
        }
        let late = self.merged(0..BLOCKS / 2);
        let early = self.merged(BLOCKS / 2..BLOCKS);
        let mut window = early;
        window.merge(&late);
        let change = (late.rate.mean - early.rate.mean).norm();
        window.rate.count >= SAMPLES_MIN
            && window.rate.deviation() < self.rate_max_rad_s
            && window.acceleration.deviation() < self.acceleration_max_m_s2
            && change < self.bias_change_max_rad_s
            && self.can_be_bias(window.rate.mean)
    }

    fn can_be_bias(&self, rate_rad_s: Vector3<f64>) -> bool {
        let (center, reach) = match self.expected {
            // Three sigma: a true bias is outside once in 400 standstills.
            Some((bias, sigma)) => (bias, self.bias_change_max_rad_s + 3.0 * sigma),
            None => (Vector3::zeros(), self.bias_max_rad_s),
        };
        (rate_rad_s - center).norm() < reach.min(self.bias_max_rad_s)
    }
}

impl Block {
    fn at(begin_ns: i64) -> Self {
        Self {
            begin_ns,
            end_ns: begin_ns,
            ..Self::default()
        }
    }

    fn push(&mut self, stamp_ns: i64, rate_rad_s: Vector3<f64>, acceleration_m_s2: Vector3<f64>) {
        self.end_ns = stamp_ns;
        self.rate.push(rate_rad_s);
        self.acceleration.push(acceleration_m_s2);
    }

    /// Adds a later block.
    fn merge(&mut self, later: &Self) {
        if self.rate.count == 0.0 {
            self.begin_ns = later.begin_ns;
        }
        self.end_ns = later.end_ns;
        self.rate.merge(&later.rate);
        self.acceleration.merge(&later.acceleration);
    }
}

#[cfg(test)]
mod tests;
