//! The IMU alone, held against the radar over a span: ground that keeps its place ahead of the
//! robot pulls scan by scan by less than shows, and over a second or two by more.

use super::{
    RadarFix,
    inertial_state::{InertialState, WAY, single},
};
use nalgebra::Vector3;
use randt_config::Odometry;
use randt_geometry::Pose2;
use randt_persist::persist;

/// The longest span, ns: what the IMU does not know adds up, and what is wrong shows by then.
const SPAN_NS: i64 = 2_000_000_000;
/// Ways that differ by more standard deviations do not agree, of those that sound spans show.
const DIFFER_SIGMAS: f64 = 3.0;
/// Spans whose mean square is remembered, half a minute, and what it is taken for before the first:
/// an IMU that is mounted off the robot's centre, or scaled by a percent, differs by more than its
/// noise.
const MEMORY_SPANS: f64 = 15.0;
const FIRST_MEAN_SQUARE: f64 = 9.0;

/// A filter as it was when radar and IMU last agreed, moved on by the IMU alone.
#[derive(Clone, Debug)]
pub struct Unaided {
    state: InertialState,
    /// Stamp and pose in `odom` of the scan at which the span began.
    begin: Option<(i64, Pose2)>,
    /// Whether the way agreed at the last scan that the radar fixed.
    agrees: bool,
    /// Whether it did not over the last span.
    differed: bool,
    /// Square of what the span's ways differ by so far, in the filter's variances, and the mean of
    /// the last spans'.
    square: f64,
    mean_square: f64,
}

persist!(Unaided {
    state,
    begin,
    agrees,
    differed,
    square,
    mean_square
});

impl Unaided {
    /// Without a span.
    pub fn new(odometry: &Odometry) -> Self {
        Self {
            state: InertialState::new(odometry),
            begin: None,
            agrees: true,
            differed: false,
            square: 0.0,
            mean_square: FIRST_MEAN_SQUARE,
        }
    }

    /// Nothing has been said.
    pub fn restart(&mut self) {
        self.stop();
        self.differed = false;
    }

    /// The next scan that the radar fixes begins a span.
    pub fn stop(&mut self) {
        self.begin = None;
    }

    /// Whether radar and IMU did not have the same way over the last span.
    pub fn differs(&self) -> bool {
        self.differed
    }

    /// Integrates a sample.
    pub fn integrate(&mut self, dt_ns: i64, rate_rad_s: Vector3<f64>, force_m_s2: Vector3<f64>) {
        if self.begin.is_some() {
            self.state.integrate(dt_ns, rate_rad_s, force_m_s2);
        }
    }

    /// A scan ends here, up to which `aided` used what the radar said; variances are `scale` times
    /// what the filter says. Where the span ends, after its time or because the radar does not fix
    /// the way any more, and the two ways do not agree: the filter as the IMU alone has it.
    pub fn observe_scan(
        &mut self,
        stamp_ns: i64,
        fix: Option<&RadarFix>,
        aided: &InertialState,
        scale: f64,
    ) -> Option<InertialState> {
        let Some((begin_ns, odom_from_begin)) = self.begin else {
            self.begin(stamp_ns, fix, Some(aided));
            // What differed was before the radar lost the way.
            self.differed &= fix.is_none();
            return None;
        };
        if let Some(fix) = fix {
            self.state.propagate();
            let way_m = -fix.pose.between(&odom_from_begin).translation().x;
            let innovation = way_m - self.state.way_m.x;
            let [sigma_m, _] = fix.sigma_m;
            let variance = self.state.variance(&single(WAY)) * scale + sigma_m * sigma_m;
            self.square = innovation * innovation / variance;
            self.agrees = self.square <= self.square_max();
        }
        if fix.is_some() {
            if stamp_ns.saturating_sub(begin_ns) < SPAN_NS {
                return None;
            }
            // One that differs counts for no more than it may: what differs again and again is
            // the IMU's own.
            let square = self.square.min(self.square_max());
            self.mean_square += (square - self.mean_square) / MEMORY_SPANS;
        }
        if self.agrees {
            self.begin(stamp_ns, fix, Some(aided));
            self.differed = false;
            return None;
        }
        self.begin(stamp_ns, fix, None);
        self.differed = true;
        Some(self.state.clone())
    }

    fn square_max(&self) -> f64 {
        DIFFER_SIGMAS * DIFFER_SIGMAS * self.mean_square.max(1.0)
    }

    /// Begins a span where the radar fixes a scan, from the filter that used it or, without one,
    /// as it went on alone.
    fn begin(&mut self, stamp_ns: i64, fix: Option<&RadarFix>, aided: Option<&InertialState>) {
        self.begin = fix.map(|fix| (stamp_ns, fix.pose));
        if let Some(aided) = aided {
            self.state = aided.clone();
        }
        self.state.begin_way();
        self.agrees = true;
    }
}
