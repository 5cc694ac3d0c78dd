//! A radar that lies, or sees badly.

use super::Change;
use super::returns::{add_echo, edit, keep_beams};
use randt_geometry::elementary::{PI, ln, wrap};
use randt_messages::{Message, RadarScan};
use randt_readers::Event;
use randt_simulator::{RadarProfile, Random};

/// Share of scans that another radar's burst meets, the sector that it fills, rad, and returns a
/// beam there.
const BURST_SHARE: f64 = 0.5;
const BURST_RAD: f64 = PI / 3.0;
const BURST_RETURNS: usize = 40;
/// Levels of a burst's returns, dB.
const BURST_DB: [f64; 2] = [10.0, 35.0];
/// Drops in a beam, how far off they are on average, m, and their level at 1 m, dB; it falls by 20
/// dB a decade.
const DROPS: usize = 4;
const DROP_M: f64 = 2.5;
const DROP_DB: f64 = 20.0;
/// Share of beams with a ghost, and how much stronger it is than what it repeats, dB.
const GHOST_SHARE: f64 = 1.0 / 7.0;
const GHOST_DB: f64 = 3.0;
/// Share of beams that are lost.
const LOST_SHARE: f64 = 0.3;
/// The hidden sector.
const SECTOR_RAD: f64 = PI / 2.0;
/// Ranges against the true ones.
const RANGE_SCALE: f32 = 1.01;
/// Loss of gain.
const FADING_DB_S: f64 = 0.06;
/// Largest error of a scan's stamps.
const JITTER_NS: f64 = 15e6;
/// Share of scans that are missing, and the longer gaps: their period and their length.
const MISSING_SHARE: f64 = 0.05;
const GAP_EVERY_S: f64 = 20.0;
const GAP_S: f64 = 1.0;

/// A change of scans only.
fn scans(mut change: impl FnMut(&mut Message<RadarScan>, f64) -> bool + 'static) -> Change {
    Box::new(move |event, at_s| match event {
        Event::Scan(scan) => change(scan, at_s),
        _ => true,
    })
}

/// It turns the other way round.
pub(super) fn mirrored() -> Change {
    scans(|scan, _| {
        for beam in &mut scan.head.sweep.beams {
            beam.azimuth_rad = -beam.azimuth_rad;
        }
        true
    })
}

/// Its ranges are too long.
pub(super) fn range_scale() -> Change {
    scans(|scan, _| {
        for item in &mut scan.items {
            item.range_m *= RANGE_SCALE;
        }
        true
    })
}

/// Its receiver loses gain.
pub(super) fn fading() -> Change {
    scans(|scan, at_s| {
        let fall_db = (FADING_DB_S * at_s) as f32;
        for item in &mut scan.items {
            item.intensity -= fall_db;
        }
        true
    })
}

/// It repeats one scan.
pub(super) fn frozen(from_s: f64, for_s: f64) -> Change {
    let mut last: Option<Message<RadarScan>> = None;
    scans(move |scan, at_s| {
        match &last {
            Some(last) if (from_s..from_s + for_s).contains(&at_s) => {
                scan.items.clone_from(&last.items);
                let sweep = &mut scan.head.sweep;
                sweep.beam_count = last.head.sweep.beam_count;
                for (beam, old) in sweep.beams.iter_mut().zip(&last.head.sweep.beams) {
                    beam.azimuth_rad = old.azimuth_rad;
                    beam.first_return = old.first_return;
                }
            }
            _ => last = Some(scan.clone()),
        }
        true
    })
}

/// Another radar's bursts.
pub(super) fn interference(from_s: f64, for_s: f64, mut random: Random) -> Change {
    let profile = RadarProfile::isdr_c();
    let range_max_m = f64::from(profile.bins) * profile.bin_m;
    scans(move |scan, at_s| {
        if !(from_s..from_s + for_s).contains(&at_s) || random.unit() >= BURST_SHARE {
            return true;
        }
        let middle_rad = random.between(-PI, PI);
        edit(scan, |beam, returns| {
            let off_rad = wrap(f64::from(beam.azimuth_rad) - middle_rad);
            if 2.0 * off_rad.abs() < BURST_RAD {
                for _ in 0..BURST_RETURNS {
                    let range_m = random.between(0.0, range_max_m);
                    let level_db = random.between(BURST_DB[0], BURST_DB[1]);
                    add_echo(returns, range_m, level_db, &mut random);
                }
            }
        });
        true
    })
}

/// Drops in every beam.
pub(super) fn rain(mut random: Random) -> Change {
    scans(move |scan, _| {
        edit(scan, |_, returns| {
            for _ in 0..DROPS {
                let range_m = (DROP_M * random.exponential()).max(0.1);
                let fall_db = 20.0 * ln(range_m) / core::f64::consts::LN_10;
                add_echo(returns, range_m, DROP_DB - fall_db, &mut random);
            }
        });
        true
    })
}

/// Some beams see their strongest echo again at twice the range, by way of the robot.
pub(super) fn ghosts(mut random: Random) -> Change {
    /// Nearer is the radar's own cover.
    const NEAR_M: f32 = 0.5;
    scans(move |scan, _| {
        edit(scan, |_, returns| {
            if random.unit() >= GHOST_SHARE {
                return;
            }
            let far = returns.iter().filter(|one| one.range_m > NEAR_M);
            let strongest = far.max_by(|a, b| a.intensity.total_cmp(&b.intensity));
            if let Some(strongest) = strongest.copied() {
                let range_m = 2.0 * f64::from(strongest.range_m);
                let level_db = f64::from(strongest.intensity) + GHOST_DB;
                add_echo(returns, range_m, level_db, &mut random);
            }
        });
        true
    })
}

/// Beams are lost on their way, other ones in every scan.
pub(super) fn beams_lost(mut random: Random) -> Change {
    scans(move |scan, _| {
        keep_beams(scan, |_| random.unit() >= LOST_SHARE);
        true
    })
}

/// Something on the robot hides a sector.
pub(super) fn sector(mut random: Random) -> Change {
    let middle_rad = random.between(-PI, PI);
    scans(move |scan, _| {
        edit(scan, |beam, returns| {
            let off_rad = wrap(f64::from(beam.azimuth_rad) - middle_rad);
            if 2.0 * off_rad.abs() < SECTOR_RAD {
                returns.clear();
            }
        });
        true
    })
}

/// A clock that stamps scans badly.
pub(super) fn jitter(mut random: Random) -> Change {
    scans(move |scan, _| {
        shift(scan, random.between(-JITTER_NS, JITTER_NS) as i64);
        true
    })
}

/// Scans are missing.
pub(super) fn gaps(mut random: Random) -> Change {
    scans(move |_, at_s| {
        let is_kept = random.unit() >= MISSING_SHARE;
        is_kept && at_s.rem_euclid(GAP_EVERY_S) < GAP_EVERY_S - GAP_S
    })
}

/// Moves all stamps of a scan.
pub(super) fn shift(scan: &mut Message<RadarScan>, by_ns: i64) {
    scan.head.header.stamp_ns += by_ns;
    let sweep = &mut scan.head.sweep;
    sweep.begin_ns += by_ns;
    sweep.end_ns += by_ns;
    let count = sweep.beams().len();
    for beam in sweep.beams.iter_mut().take(count) {
        beam.stamp_ns += by_ns;
    }
}
