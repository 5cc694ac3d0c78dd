//! One beam's echo: amplitudes by range bin, noise, threshold.

use crate::material::amplitude;
use crate::{RadarProfile, Random};
use randt_geometry::elementary::{PI, exp, ln, pow, sin_cos};

/// Bins to either side of an echo over which the range response reaches; 44 dB down at its end.
const REACH: usize = 7;
/// Range response: dB down a squared bin. A Gaussian main lobe fitted to single reflectors of
/// room.bag (33 dB down 6 bins away, 1.5 dB down 1.2 bins away).
const RESPONSE_DB: f64 = 0.9;
/// The response is tabled in this many steps a bin; half a step is 0.02 dB near the peak.
const STEPS: usize = 32;
/// Phases are drawn from this many; a power of two.
const PHASES: usize = 256;

/// Echoes of a smaller amplitude are not seen: 20 dB under the noise.
const UNSEEN: f32 = 0.1;

/// The bins of one beam.
#[derive(Clone, Debug)]
pub(crate) struct Echo {
    bins: Vec<(f32, f32)>,
    // Amplitude of each bin's own noise: 1, more under the radome.
    noise: Vec<f32>,
    response: Vec<[f32; 2 * REACH + 1]>,
    phases: Vec<(f32, f32)>,
    // Echoes' amplitude by bin: the fall with range.
    fall: Vec<f32>,
    per_m: f64,
    threshold: f64,
    noise_log: f64,
}

impl Echo {
    pub fn new(profile: &RadarProfile) -> Self {
        let bins = usize::from(profile.bins);
        let response = (0..STEPS)
            .map(|step| {
                core::array::from_fn(|tap| {
                    let distance = tap as f64 - REACH as f64 - (step as f64 + 0.5) / STEPS as f64;
                    amplitude(-RESPONSE_DB * distance * distance) as f32
                })
            })
            .collect();
        let phases = (0..PHASES)
            .map(|phase| {
                let (sin, cos) = sin_cos(2.0 * PI * phase as f64 / PHASES as f64);
                (cos as f32, sin as f32)
            })
            .collect();
        let fall = (0..bins)
            .map(|bin| {
                let range_m = ((bin as f64 + 0.5) * profile.bin_m).max(0.1);
                // decades x dB a decade, in amplitude.
                pow(range_m, -profile.fall_db_decade / 20.0) as f32
            })
            .collect();
        let threshold = pow(10.0, profile.threshold_db / 10.0);
        Self {
            bins: vec![(0.0, 0.0); bins],
            noise: (0..profile.bins)
                .map(|bin| noise_amplitude(profile, bin))
                .collect(),
            response,
            phases,
            fall,
            per_m: 1.0 / profile.bin_m,
            threshold,
            // Noise alone passes the threshold with probability exp(-threshold).
            noise_log: ln(1.0 - exp(-threshold)),
        }
    }

    /// Adds an echo with a random phase.
    pub fn add(&mut self, random: &mut Random, range_m: f64, amplitude: f64) {
        let position = range_m * self.per_m;
        let centre = position as usize;
        let Some(fall) = self.fall.get(centre) else {
            return;
        };
        let amplitude = amplitude as f32 * fall;
        if amplitude < UNSEEN {
            return;
        }
        let (cos, sin) = phase(&self.phases, random);
        let step = ((position - centre as f64) * STEPS as f64) as usize;
        let Some(response) = self.response.get(step.min(STEPS - 1)) else {
            return;
        };
        let (re, im) = (amplitude * cos, amplitude * sin);
        // The first taps fall before the first bin where the echo is that near.
        let skipped = REACH.saturating_sub(centre);
        let first = centre.saturating_sub(REACH);
        let taps = response.get(skipped..).unwrap_or_default();
        for (bin, tap) in self.bins.iter_mut().skip(first).zip(taps) {
            bin.0 += re * tap;
            bin.1 += im * tap;
        }
    }

    /// Expected power of an echo in a bin, as [`Echo::add`] gets it.
    pub fn power(&self, range_m: f64, echo: f64, bin: u16) -> f64 {
        let position = range_m * self.per_m;
        let distance = position - f64::from(bin);
        let fall = self.fall.get(position as usize).copied();
        let Some(fall) = fall.filter(|_| distance.abs() <= REACH as f64) else {
            return 0.0;
        };
        let reached = echo * f64::from(fall) * amplitude(-RESPONSE_DB * distance * distance);
        reached * reached
    }

    /// Power above which a bin is a return.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Adds noise, gives every bin above the threshold with its intensity in dB, and empties the
    /// bins.
    pub fn detect(&mut self, random: &mut Random, mut found: impl FnMut(u16, f32)) {
        let threshold = self.threshold;
        let noise_log = self.noise_log;
        let db = |power: f64| (10.0 / core::f64::consts::LN_10 * ln(power)) as f32;
        // Bins of pure noise until the next one above the threshold; geometric, so that the 98 %
        // below it cost no random numbers.
        let gap = |random: &mut Random| (-random.exponential() / noise_log) as u32;
        let mut quiet = gap(random);
        for (index, (bin, noise)) in self.bins.iter_mut().zip(&self.noise).enumerate() {
            let (re, im) = *bin;
            if re * re + im * im < UNSEEN * UNSEEN && *noise == 1.0 {
                if quiet == 0 {
                    found(index as u16, db(threshold + random.exponential()));
                    quiet = gap(random);
                } else {
                    quiet -= 1;
                }
            } else {
                // Complex normal noise: exponential power, any phase.
                let size = f64::from(*noise) * random.exponential().sqrt();
                let (cos, sin) = phase(&self.phases, random);
                let (re, im) = (
                    f64::from(re) + size * f64::from(cos),
                    f64::from(im) + size * f64::from(sin),
                );
                let power = re * re + im * im;
                if power > threshold {
                    found(index as u16, db(power));
                }
            }
            *bin = (0.0, 0.0);
        }
    }
}

/// Cosine and sine of a random phase.
fn phase(phases: &[(f32, f32)], random: &mut Random) -> (f32, f32) {
    let index = random.next_u64() as usize % PHASES;
    phases.get(index).copied().unwrap_or_default()
}

/// Amplitude of a bin's own noise; the radome's echo is noise to us, anew in each beam.
fn noise_amplitude(profile: &RadarProfile, bin: u16) -> f32 {
    let [first, peak, last] = profile.radome_bins;
    if !(first..=last).contains(&bin) {
        return 1.0;
    }
    let end = if bin < peak { first } else { last };
    let share = f64::from(bin.abs_diff(peak)) / f64::from(end.abs_diff(peak).max(1));
    let [top_db, end_db] = profile.radome_db;
    amplitude(top_db + (end_db - top_db) * share) as f32
}
