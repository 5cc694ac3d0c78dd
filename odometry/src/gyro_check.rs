//! Whether the gyro turns as the radar does: it loses its trust where it does not, and may earn it
//! again.

mod bias_change;
mod bias_drift;
mod fault;
mod sample_holes;
mod turns;
mod wanted_means;
mod yaw_regression;

pub use bias_change::BiasChange;
pub use fault::GyroFault;
pub use yaw_regression::ScanEvidence;

use crate::{
    gravity_check::GravityCheck, gyro_integrator::Turn, gyro_measurement::GyroMeasurement,
    gyro_rates::GyroRates, sliding_window::WindowScan,
};
use bias_drift::BiasDrift;
use randt_messages::Localizability as Seen;
use randt_persist::persist;
use sample_holes::SampleHoles;
use turns::{TurnPair, Turns};
use wanted_means::WantedMeans;
use yaw_regression::{GyroStep, WantedTurn, YawRegression};

/// A bias that has moved is unknown by this much, rad/s (1 degree/s) ...
const BIAS_JUMP_SIGMA_RAD_S: f64 = 0.0175;
/// ... and walks by this for a while, rad/s per square root of s: one that creeps by a degree/s in
/// 100 s is followed.
const UNSTEADY_WALK: f64 = 0.003;
const UNSTEADY_NS: i64 = 60_000_000_000;
/// A bias that a gyro is believed with again, rad/s: to a fifth of a degree/s.
const EARNED_SIGMA_RAD_S: f64 = 0.0035;
/// Scans of the last ten that do not fit where the gyro has them, from which it is tried whether
/// they fit without it.
const POOR_FITS: u32 = 2;
const FIT_SCANS: u32 = 10;
/// A turn that differs by this much from that of the scan before, rad (20 degrees), is the gyro's
/// and no robot's if the scan does not fit: the next ones would already be predicted by it.
const JERK_RAD: f64 = 0.35;
/// Scans in which gyro and radar have to agree until the gyro is used again; twice as many each
/// further time, at most [`Turns::ROOM`].
const AGREE_SCANS: usize = 25;
/// Turning on average faster than this is no robot, whose radar would show nothing, rad/s (460
/// degrees/s).
const RATE_MAX_RAD_S: f64 = 8.0;
/// How long a gyro that has lost its trust, or whose samples lacked, keeps the pose's away, ns:
/// until the radar has shown by itself that it fits.
const DOUBT_NS: i64 = 2_000_000_000;

/// A delay of a gyro that was refused which is set right, ms: what is less does no harm.
const LATE_MIN_MS: i64 = 20;
/// A rate that was repeated this long before a gyro was refused is why, ns.
const REPEATED_NS: i64 = 5_000_000_000;

/// What follows from a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Nothing changes.
    Keep,
    /// It is to be tried whether the scans fit without the gyro.
    Try,
    /// The gyro is wrong.
    Refuse,
    /// Its stamps are later than they are read, ns.
    Late(i64),
}

/// Follows radar and gyro scan by scan.
///
/// What a scan alone still wants to turn, at the solution that radar and gyro have in common, is
/// noise where both are right: its mean over some seconds is next to nothing. Its fields are what
/// is compared, what was found, and what follows for the next scan.
#[derive(Clone, Debug)]
pub struct GyroCheck {
    wanted: WantedMeans,
    turns: Turns,
    regression: YawRegression,
    drift: BiasDrift,
    /// Heading of the scan before, where the radar saw it.
    last_yaw_rad: Option<f64>,
    /// The gyro's turn up to the scan before, rad.
    last_turn_rad: Option<f64>,
    /// The last [`FIT_SCANS`] scans, the newest one the lowest bit: 1 where it did not fit.
    poor_fits: u32,
    /// Scans since it was last tried.
    since_tried: u32,
    /// Whether the scans want to turn by more than the bias allows.
    is_unsteady: bool,
    /// Since when the gyro is not used.
    refused_ns: Option<i64>,
    /// What is wrong with it, as last found.
    fault: GyroFault,
    /// How late its stamps were found to be, ms.
    late_ms: i64,
    /// How often it was refused.
    refusals: u32,
    /// Until when its bias may walk, ns.
    unsteady_until_ns: i64,
    /// The bias that it is used with again; the next scan takes it.
    earned_bias_rad_s: Option<f64>,
    /// Whether the bias is unknown from the next scan on.
    loosens: bool,
    /// How often it became so.
    pub bias_changes: u64,
    holes: SampleHoles,
    /// The gyro's turn since the scan before.
    turn: Option<Turn>,
}

persist!(GyroCheck {
    wanted,
    turns,
    regression,
    drift,
    last_yaw_rad,
    last_turn_rad,
    poor_fits,
    since_tried,
    is_unsteady,
    refused_ns,
    fault,
    late_ms,
    refusals,
    unsteady_until_ns,
    earned_bias_rad_s,
    loosens,
    bias_changes,
    holes,
    turn,
} sound is_sound);

impl GyroCheck {
    /// Nothing compared yet: the gyro is used.
    pub fn new() -> Self {
        Self {
            wanted: WantedMeans::default(),
            turns: Turns::with_room(),
            regression: YawRegression::default(),
            drift: BiasDrift::default(),
            last_yaw_rad: None,
            last_turn_rad: None,
            poor_fits: 0,
            since_tried: POOR_FITS,
            is_unsteady: false,
            refused_ns: None,
            fault: GyroFault::None,
            late_ms: 0,
            refusals: 0,
            unsteady_until_ns: 0,
            earned_bias_rad_s: None,
            loosens: false,
            bias_changes: 0,
            holes: SampleHoles::default(),
            turn: None,
        }
    }

    fn is_sound(&self) -> bool {
        self.poor_fits >> FIT_SCANS == 0
            && self.refusals <= u32::MAX / 2
            && self.bias_changes <= u64::MAX / 2
    }

    /// Whether the gyro is not used.
    pub fn is_refused(&self) -> bool {
        self.refused_ns.is_some()
    }

    /// What is or was wrong with the gyro.
    pub fn fault(&self) -> GyroFault {
        self.fault
    }

    /// Whether it cannot be known whether radar or gyro is right: the radar has not shown yet that
    /// it fits by itself, or nothing shows which of them errs; both may turn opposite ways, each
    /// by itself without fault. Nor can it right after samples lacked: the clock may have stepped.
    pub fn is_undecided(&self, stamp_ns: i64) -> bool {
        let is_recent = |since_ns: i64| stamp_ns.saturating_sub(since_ns) < DOUBT_NS;
        match (self.refused_ns, self.fault) {
            (None, _) => self.turn.is_some() && self.holes.step_ns().is_some_and(is_recent),
            (Some(_), GyroFault::UpsideDown) => false,
            (Some(_), GyroFault::Opposite | GyroFault::Disagrees) => true,
            (Some(since_ns), _) => is_recent(since_ns),
        }
    }

    /// A frame begins: scans are not compared with those before.
    pub fn restart(&mut self) {
        self.wanted.restart();
        self.regression = YawRegression::default();
        self.drift.restart();
        (self.last_yaw_rad, self.last_turn_rad) = (None, None);
        (self.poor_fits, self.is_unsteady) = (0, false);
    }

    /// What a scan may use of what the gyro measured since the one before.
    pub fn admit(
        &mut self,
        mut measured: GyroMeasurement,
        gravity: &GravityCheck,
    ) -> GyroMeasurement {
        let had_samples = self.turn.is_some();
        self.turn = measured.term.map(|term| term.turn);
        if (self.holes).observe(measured.turn, measured.span_ns, had_samples) {
            // What was known of the delay is not known any more.
            self.regression = YawRegression::default();
        }
        let (begin_ns, end_ns) = measured.span_ns;
        let angle_max_rad = RATE_MAX_RAD_S * (end_ns - begin_ns) as f64 * 1e-9;
        let is_beyond = |turn: Turn| turn.angle_rad.abs() > angle_max_rad;
        if measured.turn.is_some_and(is_beyond) && !self.is_refused() {
            self.refuse(end_ns);
        }
        if gravity.is_upside_down() && self.fault != GyroFault::UpsideDown {
            self.refuse(end_ns);
            self.fault = GyroFault::UpsideDown;
        }
        if self.is_refused() {
            return measured.unused();
        }
        let change = &mut measured.bias_change;
        if end_ns < self.unsteady_until_ns {
            let dt_s = (end_ns - begin_ns) as f64 * 1e-9;
            change.variance = UNSTEADY_WALK * UNSTEADY_WALK * dt_s;
        }
        if std::mem::take(&mut self.loosens) {
            change.variance += BIAS_JUMP_SIGMA_RAD_S * BIAS_JUMP_SIGMA_RAD_S;
        }
        if let Some(earned_rad_s) = self.earned_bias_rad_s.take() {
            change.mean_rad_s = earned_rad_s - measured.bias_rad_s;
            change.variance += EARNED_SIGMA_RAD_S * EARNED_SIGMA_RAD_S;
        }
        measured
    }

    /// Compares a scan that was estimated.
    pub fn observe(
        &mut self,
        scan: &WindowScan,
        evidence: &ScanEvidence,
        rates: &GyroRates,
    ) -> Verdict {
        let &ScanEvidence {
            is_clear, is_poor, ..
        } = evidence;
        let stamp_ns = scan.message.head.sweep.end_ns;
        let yaw_rad = scan.state.odom_from_base.yaw_rad;
        let sees_all = is_clear && scan.localizability.seen == Seen::Full && !is_poor;
        let turn = self.turn.filter(|turn| turn.uncovered_s == 0.0);
        let last_yaw_rad = self.last_yaw_rad.take();
        self.last_yaw_rad = sees_all.then_some(yaw_rad);
        if self.is_refused() {
            if let (Some(last), Some(turn), true) = (last_yaw_rad, turn, sees_all) {
                self.turns
                    .push(TurnPair::new(last, yaw_rad, turn.angle_rad, scan.dt_s));
                self.name_fault(rates);
                if let Some(late_ns) = self.late_ns() {
                    return Verdict::Late(late_ns);
                }
                self.earn_again(stamp_ns);
            }
            return Verdict::Keep;
        }
        let step = GyroStep::from_scan(scan).filter(|_| turn.is_some() && is_clear);
        let wanted = step.and_then(|_| WantedTurn::from_scan(scan, evidence));
        self.regression.push(step.as_ref(), wanted.as_ref());
        let Some(turn) = turn.filter(|_| is_clear) else {
            self.drift.restart();
            return Verdict::Keep;
        };
        let moved = self.drift.push(scan, turn.angle_rad);
        self.poor_fits = (self.poor_fits << 1 | u32::from(is_poor)) & ((1 << FIT_SCANS) - 1);
        self.since_tried = self.since_tried.saturating_add(1);
        let last_rad = self.last_turn_rad.replace(turn.angle_rad);
        let jerks = last_rad.is_some_and(|last| (turn.angle_rad - last).abs() > JERK_RAD);
        let sweep_ns = (scan.dt_s * 1e9) as i64;
        let repeats = rates.repeated_since(stamp_ns - sweep_ns).is_some();
        let is_many = self.poor_fits.count_ones() >= POOR_FITS;
        if self.since_tried >= POOR_FITS && (repeats || is_many || jerks && is_poor) {
            return Verdict::Try;
        }
        let Some(wanted) = wanted else {
            return Verdict::Keep;
        };
        self.wanted.push(wanted.turn_rad);
        if self.wanted.are_no_bias() {
            return Verdict::Refuse;
        }
        if moved || self.wanted.show_another_bias() {
            self.is_unsteady = true;
            if self.wanted.show_in_a_window() {
                return Verdict::Try;
            }
            self.keep(stamp_ns);
        }
        match self.regression.shown() {
            (Some(delay_s), _) => Verdict::Late((delay_s * 1e9) as i64),
            (None, Some(scale)) => {
                self.refuse(stamp_ns);
                self.fault = GyroFault::scaled(1.0 + scale);
                Verdict::Keep
            }
            (None, None) => Verdict::Keep,
        }
    }

    /// The gyro's stamps are that late in all, ns, and are read so from now on.
    pub fn set_late(&mut self, late_ns: i64) {
        self.late_ms = late_ns / 1_000_000;
        self.fault = GyroFault::Delayed(self.late_ms);
        self.turns.clear();
        self.regression = YawRegression::default();
        self.drift.restart();
        self.wanted.restart();
    }

    /// How much later the stamps of a gyro that was refused are than they are read, ns, where the
    /// turns show it.
    fn late_ns(&self) -> Option<i64> {
        match (self.fault, self.turns.fault()?) {
            (GyroFault::Delayed(_), GyroFault::Delayed(ms)) if ms.abs() >= LATE_MIN_MS => {
                Some(ms * 1_000_000)
            }
            _ => None,
        }
    }

    /// The gyro stays in use: the scans do not fit better without it.
    pub fn keep(&mut self, stamp_ns: i64) {
        (self.poor_fits, self.since_tried) = (0, 0);
        if std::mem::take(&mut self.is_unsteady) {
            self.loosens = true;
            self.bias_changes += 1;
            self.unsteady_until_ns = stamp_ns.saturating_add(UNSTEADY_NS);
            self.wanted.restart();
            self.drift.restart();
        }
    }

    /// From now on the gyro is not used.
    pub fn refuse(&mut self, stamp_ns: i64) {
        self.refused_ns = Some(stamp_ns);
        self.fault = GyroFault::Disagrees;
        self.refusals += 1;
        self.turns.clear();
        self.restart();
    }

    fn name_fault(&mut self, rates: &GyroRates) {
        let is_known = self.turns.are_many() || !self.fault.is_of_turns();
        if self.fault.lasts() && is_known {
            return;
        }
        let since_ns = self.refused_ns.unwrap_or_default();
        if let Some(repeated) = rates.repeated_since(since_ns.saturating_sub(REPEATED_NS)) {
            self.fault = GyroFault::repeats(&repeated);
        } else if let Some(fault) = self.turns.fault() {
            self.fault = match fault {
                // With its stamps set right it agrees but for a bias.
                GyroFault::Biased(_) if self.late_ms != 0 => GyroFault::Delayed(self.late_ms),
                GyroFault::Delayed(ms) => GyroFault::Delayed(self.late_ms.saturating_add(ms)),
                fault => fault,
            };
        }
    }

    /// Uses the gyro again where it agrees with the radar but for a bias.
    fn earn_again(&mut self, stamp_ns: i64) {
        if self.fault.lasts() {
            return;
        }
        let scans = AGREE_SCANS << self.refusals.saturating_sub(1).min(3);
        if let Some(bias_rad_s) = self.turns.agreed_bias_rad_s(scans.min(Turns::ROOM)) {
            self.refused_ns = None;
            self.earned_bias_rad_s = Some(bias_rad_s);
            self.unsteady_until_ns = stamp_ns.saturating_add(UNSTEADY_NS);
            self.restart();
        }
    }
}

#[cfg(test)]
mod tests;
