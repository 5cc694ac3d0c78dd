//! Standing, turning, rattling: what a MEMS sensor shows of them.

use super::*;

fn detector() -> Standstill {
    Standstill::new(&randt_config::Attitude::default())
}

/// Deterministic noise in -0.5..0.5, without correlation to speak of.
fn noise(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

/// Feeds `seconds` at `hz` with noise of a MEMS sensor around `rate` and gravity.
struct Feed {
    hz: i64,
    time_ns: i64,
    seed: u64,
    measurements: Vec<StandstillBias>,
}

impl Feed {
    fn new(hz: i64) -> Self {
        Self {
            hz,
            time_ns: 0,
            seed: 1,
            measurements: Vec::new(),
        }
    }

    /// Returns the share of samples at which the detector found standstill.
    fn run(
        &mut self,
        detector: &mut Standstill,
        seconds: f64,
        rate: impl Fn(f64) -> Vector3<f64>,
        rattle_m_s2: f64,
    ) -> f64 {
        let samples = (seconds * self.hz as f64) as i64;
        let mut still = 0;
        for i in 0..samples {
            let mut random = || Vector3::from_fn(|_, _| noise(&mut self.seed));
            let measured = rate(i as f64 / self.hz as f64) + random() * 0.006;
            let force = Vector3::new(0.1, -0.2, 9.8) + random() * (0.1 + rattle_m_s2);
            self.measurements
                .extend(detector.push(self.time_ns, measured, force));
            self.time_ns += 1_000_000_000 / self.hz;
            still += i64::from(detector.still_since_ns().is_some());
        }
        still as f64 / samples as f64
    }
}

#[test]
fn standing_shows_the_bias_at_every_sampling_rate() {
    let bias = Vector3::new(0.002, -0.004, 0.008);
    for hz in [50, 100, 250, 1000] {
        let mut detector = detector();
        let mut feed = Feed::new(hz);
        let share = feed.run(&mut detector, 10.0, |_| bias, 0.0);
        assert!(share > 0.85, "{hz} Hz: still for {share}");
        assert!(detector.still_since_ns().unwrap() < 100_000_000);
        assert!(feed.measurements.len() >= 15);
        for pair in feed.measurements.windows(2) {
            assert!(pair[0].end_ns < pair[1].begin_ns, "a sample counts once");
        }
        let outside = feed.measurements.iter().flat_map(|m| {
            let error = m.bias_rad_s - bias;
            (0..3).map(move |axis| error[axis].abs() / m.sigma_rad_s[axis])
        });
        let bad = outside.filter(|&ratio| ratio > 3.5).count();
        assert!(
            bad <= feed.measurements.len() / 10,
            "{hz} Hz: {bad} off by over 3.5 sigma"
        );
    }
}

#[test]
fn a_slow_even_turn_is_no_bias() {
    let turn = |deg_s: f64| move |_: f64| Vector3::new(0.0, 0.0, deg_s.to_radians());
    let mut fresh = detector();
    assert_eq!(Feed::new(250).run(&mut fresh, 10.0, turn(2.0), 0.0), 0.0);

    let mut detector = detector();
    let mut feed = Feed::new(250);
    feed.run(&mut detector, 5.0, turn(0.3), 0.0);
    detector.expect_bias(
        feed.measurements[0].bias_rad_s,
        feed.measurements[0].sigma_rad_s,
    );
    feed.run(&mut detector, 1.0, turn(0.3), 3.0);
    assert_eq!(feed.run(&mut detector, 10.0, turn(0.8), 0.0), 0.0);
}

#[test]
fn vibration_and_a_changing_rate_are_motion() {
    let mut detector = detector();
    let mut feed = Feed::new(250);
    assert_eq!(feed.run(&mut detector, 5.0, |_| Vector3::zeros(), 1.0), 0.0);
    let rising = |t: f64| Vector3::new(0.0, 0.0, 0.015 * (t - 2.0));
    let mut detector = self::detector();
    assert_eq!(Feed::new(250).run(&mut detector, 4.0, rising, 0.0), 0.0);
}

#[test]
fn departure_is_noticed_within_the_guard_and_leaves_the_bias_clean() {
    let mut detector = detector();
    let mut feed = Feed::new(250);
    feed.run(&mut detector, 3.0, |_| Vector3::zeros(), 0.0);
    assert!(detector.still_since_ns().is_some());
    feed.run(&mut detector, 0.2, |t| Vector3::new(0.0, 0.0, 0.5 * t), 0.5);
    assert!(detector.still_since_ns().is_none());
    let worst = feed.measurements.iter().map(|m| m.bias_rad_s.norm());
    assert!(worst.fold(0.0, f64::max) < 1e-3);
}

#[test]
fn a_gap_ends_a_standstill() {
    let mut detector = detector();
    let mut feed = Feed::new(250);
    feed.run(&mut detector, 3.0, |_| Vector3::zeros(), 0.0);
    feed.time_ns += 5_000_000_000;
    feed.run(&mut detector, 0.1, |_| Vector3::zeros(), 0.0);
    assert!(detector.still_since_ns().is_none());
}
