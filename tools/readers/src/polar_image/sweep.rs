//! A sweep's message from a polar image, with the time of each beam.

use super::{AZIMUTHS, PolarImage, Row};
use crate::limit::strongest;
use crate::sweep::{find_first_returns, wrap_f32};
use randt_geometry::{Rotation, elementary::PI};
use randt_messages::{Beam, MAX_RETURNS, Message, RadarScan, Return, SensorKind};

/// Where the range bins lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RangeBins {
    /// Width of one, m.
    pub size_m: f64,
    /// Where the first one begins, m.
    pub offset_m: f64,
}

/// Makes the message. Also gives the number of returns over the limit.
pub(crate) fn build(
    image: &PolarImage,
    range_bins: RangeBins,
    power_min: f32,
    sequence: u64,
) -> (Message<RadarScan>, usize) {
    let mut message = Message::<RadarScan>::default();
    let rows: Vec<Row> = image.rows().collect();
    let turn = i64::from(image.turn);
    let unwrapped = unwrap(rows.iter().map(|row| row.encoder), turn);
    let times = rows.iter().map(|row| row.time);
    let stamps = unwrapped.iter().copied().zip(times);
    let (Some(first), Some(last)) = (rows.first(), unwrapped.last()) else {
        return (message, 0);
    };
    let rotation = Rotation::fit(stamps, first.time, image.ns_per_tick);
    let step = step(&unwrapped, turn);

    let head = &mut *message.head;
    let sweep = &mut head.sweep;
    // A beam's time is the middle of its share of the turn.
    sweep.begin_ns = rotation.ns(-0.5 * step);
    sweep.end_ns = rotation.ns(*last as f64 + 0.5 * step);
    head.header.sequence = sequence;
    head.header.stamp_ns = sweep.end_ns;
    sweep.sensor = SensorKind::NavtechCts as u32;
    sweep.range_resolution_m = range_bins.size_m as f32;
    let rad_per_count = 2.0 * PI / turn as f64;
    sweep.azimuth_step_rad = (step * rad_per_count) as f32;
    sweep.beam_count = rows.len() as u32;
    let expected = (turn as f64 / step).round() as usize;
    sweep.beams_lost = expected.saturating_sub(rows.len()) as u32;

    for (index, (row, counts)) in rows.iter().zip(&unwrapped).enumerate() {
        if let Some(beam) = sweep.beams.get_mut(index) {
            *beam = Beam {
                stamp_ns: rotation.ns(*counts as f64),
                // The encoder counts clockwise; azimuths in our messages are counter-clockwise, as
                // REP-103 has them.
                azimuth_rad: wrap_f32(-f64::from(row.encoder) * rad_per_count),
                first_return: message.items.len() as u32,
            };
        }
        let powers = row.powers.iter().enumerate();
        let kept = powers.filter(|(_, power)| f32::from(**power) > power_min);
        message.items.extend(kept.map(|(bin, power)| Return {
            // The middle of the bin, as in the data set's own conversion to Cartesian images.
            range_m: ((bin as f64 + 0.5) * range_bins.size_m + range_bins.offset_m) as f32,
            intensity: f32::from(*power),
            beam: index as u16,
            bin: bin as u16,
        }));
    }
    let over = message.items.len().saturating_sub(MAX_RETURNS);
    if over > 0 {
        message.items = strongest(&message.items, |item| item.intensity);
        find_first_returns(&mut message);
        message.head.sweep.returns_dropped = over as u32;
    }
    (message, over)
}

/// Counts since the first row, over the encoder's zero.
fn unwrap(encoders: impl Iterator<Item = u16>, turn: i64) -> Vec<i64> {
    let mut previous = None;
    let mut sum = 0;
    encoders
        .map(|encoder| {
            let encoder = i64::from(encoder);
            sum += (encoder - previous.unwrap_or(encoder)).rem_euclid(turn);
            previous = Some(encoder);
            sum
        })
        .collect()
}

/// Median step between rows, counts; the radar's 400 azimuths where there is one row only.
fn step(unwrapped: &[i64], turn: i64) -> f64 {
    let steps = unwrapped.iter().zip(unwrapped.iter().skip(1));
    let mut steps: Vec<i64> = steps.map(|(a, b)| b - a).filter(|step| *step > 0).collect();
    steps.sort_unstable();
    let median = steps.get(steps.len() / 2);
    median.map_or(turn as f64 / AZIMUTHS as f64, |step| *step as f64)
}
