//! How radar and gyro turned, scan by scan, while the gyro is not used.

use super::GyroFault;
use randt_geometry::elementary::wrap;
use randt_persist::persist;
use std::collections::VecDeque;

/// How many scans in a row are taken together, and by how much their turns must change from which
/// a comparison means something, rad: an even turn hides scale, bias and delay in each other.
const TOGETHER: usize = 5;
const CHANGES_MIN_RAD: f64 = 0.15;
/// Scans from which a fault has a name.
const NAMED_SCANS: usize = 10;
/// ... and from which it keeps it.
const MANY_SCANS: usize = 50;
/// Ratio of the gyro's turns to the radar's up to which they differ by a scale.
const RATIO_TOLERANCE: f64 = 0.1;
/// Ratio of turns that are opposite: scans that are off by a third of a degree each bring it nearer
/// to zero where turns are slow.
const OPPOSITE: core::ops::Range<f64> = -1.5..-0.4;
/// Share of the gyro's turns that a ratio must explain, where a delay does not, and from which no
/// delay is looked for: one of 0.3 s leaves a tenth of a robot's turns open.
const EXPLAINED_MIN: f64 = 0.8;
const CLEAR_MIN: f64 = 0.97;
/// Largest bias of a gyro that is used again, rad/s (5 degrees/s): more is no bias.
const BIAS_MAX_RAD_S: f64 = 0.09;
/// In an even turn as many times that is no bias.
const EVEN_BIASES: f64 = 3.0;
/// How far the headings of gyro and radar may run apart on the way, rad (1 degree: a scan by
/// itself has 0.3).
const APART_MAX_RAD: f64 = 0.0175;
/// Delays between the clocks that are looked for, in steps of this, s, to both sides.
const DELAY_STEP_S: f64 = 0.05;
const DELAY_STEPS: i32 = 20;
/// A delay explains what a ratio does not where this share of the difference is left, and no more
/// than headings may run apart.
const DELAY_LEFT_MAX: f64 = 0.25;

/// What a ratio of turns shows.
fn of_ratio(ratio: f64) -> GyroFault {
    match OPPOSITE.contains(&ratio) {
        true => GyroFault::Opposite,
        false => GyroFault::scaled(ratio),
    }
}

/// Turns between two scans.
#[derive(Clone, Copy, Debug, Default)]
pub struct TurnPair {
    radar_rad: f64,
    gyro_rad: f64,
    dt_s: f64,
}

persist!(TurnPair {
    radar_rad,
    gyro_rad,
    dt_s
});

impl TurnPair {
    /// From the radar's headings at both scans, and the gyro's turn.
    pub fn new(from_yaw_rad: f64, to_yaw_rad: f64, gyro_rad: f64, dt_s: f64) -> Self {
        Self {
            radar_rad: wrap(to_yaw_rad - from_yaw_rad),
            gyro_rad,
            dt_s,
        }
    }
}

/// The last of them.
#[derive(Clone, Debug)]
pub struct Turns {
    pairs: VecDeque<TurnPair>,
}

persist!(Turns { pairs });

impl Turns {
    /// How many are kept: 40 s at 5 Hz.
    pub const ROOM: usize = 200;

    pub fn with_room() -> Self {
        Self {
            pairs: VecDeque::with_capacity(Self::ROOM),
        }
    }

    pub fn clear(&mut self) {
        self.pairs.clear();
    }

    pub fn push(&mut self, pair: TurnPair) {
        if self.pairs.len() == Self::ROOM {
            self.pairs.pop_front();
        }
        self.pairs.push_back(pair);
    }

    fn newest(&self, scans: usize) -> impl Iterator<Item = &TurnPair> + Clone {
        self.pairs
            .iter()
            .skip(self.pairs.len().saturating_sub(scans))
    }

    /// Whether there are enough that a name stays.
    pub fn are_many(&self) -> bool {
        self.pairs.len() >= MANY_SCANS
    }

    /// Whether there are enough of them, in which the radar's turns change.
    pub fn are_comparable(&self) -> bool {
        self.pairs.len() >= NAMED_SCANS && self.changes_rad(Self::ROOM) > CHANGES_MIN_RAD
    }

    /// By how much the radar's turns differ, some scans taken together.
    fn changes_rad(&self, scans: usize) -> f64 {
        let starts =
            self.pairs.len().saturating_sub(scans)..=self.pairs.len().saturating_sub(TOGETHER);
        let turns = starts.map(|start| {
            let together = self.pairs.iter().skip(start).take(TOGETHER);
            together.map(|pair| pair.radar_rad).sum::<f64>()
        });
        let (least, most) = turns
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), turn| {
                (least.min(turn), most.max(turn))
            });
        most - least
    }

    /// The gyro's bias, where it has agreed with the radar over that many scans but for one, and
    /// both turned.
    pub fn agreed_bias_rad_s(&self, scans: usize) -> Option<f64> {
        let newest = self.newest(scans);
        if self.pairs.len() < scans || self.changes_rad(scans) < CHANGES_MIN_RAD {
            return None;
        }
        let apart_rad: f64 = newest.clone().map(|p| p.gyro_rad - p.radar_rad).sum();
        let duration_s: f64 = newest.clone().map(|pair| pair.dt_s).sum();
        let bias_rad_s = apart_rad / duration_s;
        let mut apart_rad = 0.0;
        let agrees = newest.clone().all(|pair| {
            apart_rad += pair.gyro_rad - pair.radar_rad - bias_rad_s * pair.dt_s;
            f64::abs(apart_rad) < APART_MAX_RAD
        });
        (agrees && bias_rad_s.abs() < BIAS_MAX_RAD_S).then_some(bias_rad_s)
    }

    /// What is wrong, where the turns show it.
    pub fn fault(&self) -> Option<GyroFault> {
        if !self.are_comparable() {
            return self.fault_of_even_turn();
        }
        let scans = self.pairs.len() as f64;
        let mean = |of: fn(&TurnPair) -> f64| self.pairs.iter().map(of).sum::<f64>() / scans;
        let (radar, gyro) = (mean(|pair| pair.radar_rad), mean(|pair| pair.gyro_rad));
        let (mut rr, mut rg, mut gg) = (0.0, 0.0, 0.0);
        for pair in &self.pairs {
            let (r, g) = (pair.radar_rad - radar, pair.gyro_rad - gyro);
            (rr, rg, gg) = (rr + r * r, rg + r * g, gg + g * g);
        }
        let (ratio, explained) = (rg / rr, rg * rg / (rr * gg));
        let is_scaled = (ratio - 1.0).abs() > RATIO_TOLERANCE;
        if is_scaled && explained > CLEAR_MIN || OPPOSITE.contains(&ratio) {
            return Some(of_ratio(ratio));
        }
        if !is_scaled && self.apart(0.0)? < APART_MAX_RAD * APART_MAX_RAD {
            let bias_rad_s = (gyro - radar) * scans / self.duration_s();
            return Some(GyroFault::biased(bias_rad_s));
        }
        let delay = self.delay_s().map(GyroFault::delayed);
        delay.or_else(|| (is_scaled && explained > EXPLAINED_MIN).then(|| of_ratio(ratio)))
    }

    /// An even turn shows a ratio only where no bias can be the difference.
    fn fault_of_even_turn(&self) -> Option<GyroFault> {
        let sum = |of: fn(&TurnPair) -> f64| self.pairs.iter().map(of).sum::<f64>();
        let (radar, gyro) = (sum(|pair| pair.radar_rad), sum(|pair| pair.gyro_rad));
        let most_rad = EVEN_BIASES * BIAS_MAX_RAD_S * self.duration_s();
        let is_enough = self.pairs.len() >= NAMED_SCANS && radar.abs() > CHANGES_MIN_RAD;
        (is_enough && (gyro - radar).abs() > most_rad).then(|| of_ratio(gyro / radar))
    }

    fn duration_s(&self) -> f64 {
        self.pairs.iter().map(|pair| pair.dt_s).sum()
    }

    /// How much later the gyro turns than the radar, where that explains what they differ by: the
    /// lowest point of the parabola through the best step and those beside it.
    fn delay_s(&self) -> Option<f64> {
        let at_once = self.apart(0.0)?;
        let delays = (-DELAY_STEPS..=DELAY_STEPS).map(|step| f64::from(step) * DELAY_STEP_S);
        let found = delays.filter_map(|delay_s| Some((self.apart(delay_s)?, delay_s)));
        let (left, delay_s) = found.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let beside = (self.apart(delay_s - DELAY_STEP_S)).zip(self.apart(delay_s + DELAY_STEP_S));
        let between_s = beside.map_or(0.0, |(earlier, later)| {
            0.5 * DELAY_STEP_S * (earlier - later) / (earlier - 2.0 * left + later)
        });
        let is_inside = between_s.abs() <= DELAY_STEP_S;
        let left_max = (DELAY_LEFT_MAX * at_once).min(APART_MAX_RAD * APART_MAX_RAD);
        (is_inside && left < left_max).then_some(delay_s + between_s)
    }

    /// Mean square of what the headings differ by where the gyro's is read that much later, a
    /// drift taken out, rad^2.
    fn apart(&self, delay_s: f64) -> Option<f64> {
        let duration_s = self.duration_s();
        let (mut count, mut sums) = (0.0, [0.0; 5]);
        let (mut at_s, mut radar_rad) = (0.0, 0.0);
        for pair in &self.pairs {
            at_s += pair.dt_s;
            radar_rad += pair.radar_rad;
            let read_s = at_s + delay_s;
            if read_s < 0.0 || read_s > duration_s {
                continue;
            }
            let d = self.gyro_heading_rad(read_s) - radar_rad;
            count += 1.0;
            for (sum, value) in sums.iter_mut().zip([at_s, d, at_s * at_s, at_s * d, d * d]) {
                *sum += value;
            }
        }
        let [t, d, tt, td, dd] = sums.map(|sum| sum / count);
        let slope = (td - t * d) / (tt - t * t);
        let apart = dd - d * d - slope * (td - t * d);
        (count >= NAMED_SCANS as f64 && apart.is_finite()).then_some(apart.max(0.0))
    }

    /// The gyro's heading since the first pair, straight between scans.
    fn gyro_heading_rad(&self, read_s: f64) -> f64 {
        let (mut at_s, mut heading_rad) = (0.0, 0.0);
        for pair in &self.pairs {
            if at_s + pair.dt_s >= read_s {
                return heading_rad + pair.gyro_rad * (read_s - at_s) / pair.dt_s.max(1e-3);
            }
            (at_s, heading_rad) = (at_s + pair.dt_s, heading_rad + pair.gyro_rad);
        }
        heading_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use randt_geometry::elementary::{cos, sin};

    const DT_S: f64 = 0.2;

    /// Heading of a robot that turns to and fro, rad.
    fn heading_rad(at_s: f64) -> f64 {
        0.8 * sin(0.7 * at_s) + 0.3 * cos(0.31 * at_s)
    }

    /// Turns of that robot, as a gyro has them whose heading is given.
    fn turns(gyro_rad: impl Fn(f64) -> f64) -> Turns {
        let mut turns = Turns::with_room();
        for number in 0..100 {
            let (from_s, to_s) = (DT_S * f64::from(number), DT_S * f64::from(number + 1));
            let gyro_rad = gyro_rad(to_s) - gyro_rad(from_s);
            turns.push(TurnPair::new(
                heading_rad(from_s),
                heading_rad(to_s),
                gyro_rad,
                DT_S,
            ));
        }
        turns
    }

    #[test]
    fn a_fault_has_its_name() {
        let fault = |gyro_rad: fn(f64) -> f64| turns(gyro_rad).fault();
        assert_eq!(fault(|at_s| -heading_rad(at_s)), Some(GyroFault::Opposite));
        let Some(GyroFault::Scaled(permille)) = fault(|at_s| 57.296 * heading_rad(at_s)) else {
            panic!("no scale");
        };
        assert!((57_200..57_400).contains(&permille), "{permille}");
        let Some(GyroFault::Delayed(ms)) = fault(|at_s| heading_rad(at_s - 0.6)) else {
            panic!("no delay");
        };
        assert!((550..=650).contains(&ms), "{ms}");
        let Some(GyroFault::Biased(millideg_s)) = fault(|at_s| heading_rad(at_s) + 0.0175 * at_s)
        else {
            panic!("no bias");
        };
        assert!((990..1010).contains(&millideg_s), "{millideg_s}");
        // What has nothing to do with the radar has no name.
        assert_eq!(fault(|at_s| sin(2.9 * at_s)), None);
    }

    #[test]
    fn headings_agree_but_for_a_bias() {
        let biased = turns(|at_s| heading_rad(at_s) + 0.03 * at_s);
        let bias_rad_s = biased.agreed_bias_rad_s(50).unwrap();
        assert!((bias_rad_s - 0.03).abs() < 1e-9, "{bias_rad_s}");
        assert_eq!(biased.agreed_bias_rad_s(101), None);
        for gyro_rad in [
            |at_s| heading_rad(at_s - 0.1),
            |at_s| 1.1 * heading_rad(at_s),
        ] {
            assert_eq!(turns(gyro_rad).agreed_bias_rad_s(50), None);
        }
    }

    #[test]
    fn an_even_turn_names_no_fault() {
        let mut even = Turns::with_room();
        for number in 0..100 {
            let at_rad = f64::from(number);
            even.push(TurnPair::new(0.1 * at_rad, 0.1 * (at_rad + 1.0), 0.1, DT_S));
        }
        assert!(!even.are_comparable());
        assert_eq!((even.fault(), even.agreed_bias_rad_s(50)), (None, None));
        // But what no bias can be.
        let mut even = Turns::with_room();
        (0..20).for_each(|_| even.push(TurnPair::new(0.0, 0.1, -0.1, DT_S)));
        assert_eq!(even.fault(), Some(GyroFault::Opposite));
        let mut even = Turns::with_room();
        (0..20).for_each(|_| even.push(TurnPair::new(0.0, 0.1, 5.73, DT_S)));
        assert_eq!(even.fault(), Some(GyroFault::scaled(57.3)));
    }
}
