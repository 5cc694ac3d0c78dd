//! Returns of a scan, changed beam by beam.

use randt_geometry::elementary::ln;
use randt_messages::{Beam, Message, RadarScan, Return};
use randt_simulator::{RadarProfile, Random};

/// Bins to either side of an echo, and how it falls there, dB a squared bin: the simulated radar's
/// range response.
const REACH: i32 = 3;
const RESPONSE_DB: f64 = 0.9;

/// Changes what each beam has; they are put in order again.
pub(super) fn edit(scan: &mut Message<RadarScan>, mut edit: impl FnMut(&Beam, &mut Vec<Return>)) {
    let items = std::mem::take(&mut scan.items);
    let sweep = &mut scan.head.sweep;
    let mut returns = Vec::new();
    for beam in 0..sweep.beams().len() {
        returns.clear();
        let range = sweep.returns_of(beam, items.len());
        returns.extend_from_slice(items.get(range).unwrap_or_default());
        let Some(entry) = sweep.beams.get_mut(beam) else {
            break;
        };
        edit(entry, &mut returns);
        // Of a bin the strongest stays.
        returns.sort_by(|a, b| (a.bin.cmp(&b.bin)).then(b.intensity.total_cmp(&a.intensity)));
        returns.dedup_by_key(|one| one.bin);
        entry.first_return = scan.items.len() as u32;
        let numbered = returns.iter().map(|one| Return {
            beam: beam as u16,
            ..*one
        });
        scan.items.extend(numbered);
    }
}

/// Leaves beams out, with all that they have.
pub(super) fn keep_beams(scan: &mut Message<RadarScan>, mut keep: impl FnMut(&Beam) -> bool) {
    let items = std::mem::take(&mut scan.items);
    let sweep = &mut scan.head.sweep;
    let mut kept = 0;
    let count = sweep.beams().len();
    for beam in 0..count {
        let range = sweep.returns_of(beam, items.len());
        let Some(entry) = sweep.beams.get(beam).copied().filter(&mut keep) else {
            continue;
        };
        let numbered = items.get(range).unwrap_or_default().iter();
        let first_return = scan.items.len() as u32;
        scan.items.extend(numbered.map(|one| Return {
            beam: kept as u16,
            ..*one
        }));
        if let Some(to) = sweep.beams.get_mut(kept) {
            *to = Beam {
                first_return,
                ..entry
            };
        }
        kept += 1;
    }
    sweep.beams_lost += (count - kept) as u32;
    sweep.beam_count = kept as u32;
    for rest in sweep.beams.iter_mut().take(count).skip(kept) {
        *rest = Beam::default();
    }
}

/// Level of a rough wall at this range, dB above noise.
pub(super) fn level_db(range_m: f64) -> f64 {
    let profile = RadarProfile::isdr_c();
    profile.level_db - profile.fall_db_decade * ln(range_m.max(0.1)) / core::f64::consts::LN_10
}

/// Adds an echo with speckle, as far as it is above the threshold.
pub(super) fn add_echo(
    returns: &mut Vec<Return>,
    range_m: f64,
    level_db: f64,
    random: &mut Random,
) {
    let profile = RadarProfile::isdr_c();
    let position = range_m / profile.bin_m;
    let speckle_db = 10.0 / core::f64::consts::LN_10 * ln(random.exponential().max(1e-6));
    for offset in -REACH..=REACH {
        let bin = position.round() + f64::from(offset);
        let distance = bin - position;
        let intensity = level_db + speckle_db - RESPONSE_DB * distance * distance;
        if intensity >= profile.threshold_db && (0.0..f64::from(profile.bins)).contains(&bin) {
            returns.push(Return {
                range_m: (bin * profile.bin_m) as f32,
                intensity: intensity as f32,
                beam: 0,
                bin: bin as u16,
            });
        }
    }
}

/// Something opaque in a beam's way, unless a wall stands before it: what lies behind is gone.
pub(super) fn add_body(
    returns: &mut Vec<Return>,
    range_m: f64,
    level_db: f64,
    random: &mut Random,
) {
    /// What is weaker is noise, rain or a ghost.
    const WALL_DB: f32 = 18.0;
    /// Nearer is the radar's own cover.
    const COVER_M: f32 = 0.5;
    let before = COVER_M..(range_m - 0.1) as f32;
    let is_wall = |one: &Return| one.intensity >= WALL_DB && before.contains(&one.range_m);
    if returns.iter().any(is_wall) {
        return;
    }
    returns.retain(|one| f64::from(one.range_m) < range_m);
    add_echo(returns, range_m, level_db, random);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three beams with two returns each.
    fn scan() -> Message<RadarScan> {
        let mut scan = Message::<RadarScan>::default();
        scan.head.sweep.beam_count = 3;
        for beam in 0..3_u16 {
            scan.head.sweep.beams[usize::from(beam)] = Beam {
                azimuth_rad: f32::from(beam),
                stamp_ns: i64::from(beam),
                first_return: 2 * u32::from(beam),
            };
            for bin in [100, 200] {
                scan.items.push(Return {
                    range_m: f32::from(bin) * 0.0161,
                    intensity: 20.0,
                    beam,
                    bin,
                });
            }
        }
        scan
    }

    fn bins(scan: &Message<RadarScan>, beam: usize) -> Vec<u16> {
        let range = scan.head.sweep.returns_of(beam, scan.items.len());
        let items = &scan.items[range];
        assert!(items.iter().all(|one| usize::from(one.beam) == beam));
        items.iter().map(|one| one.bin).collect()
    }

    #[test]
    fn beams_that_are_lost_take_their_returns_along() {
        let mut scan = scan();
        scan.items[4].bin = 150;
        keep_beams(&mut scan, |beam| beam.azimuth_rad != 1.0);
        let sweep = &scan.head.sweep;
        assert_eq!((sweep.beam_count, sweep.beams_lost), (2, 1));
        assert_eq!(sweep.beams[1].stamp_ns, 2);
        assert_eq!(sweep.beams[2], Beam::default());
        assert_eq!(
            (bins(&scan, 0), bins(&scan, 1)),
            (vec![100, 200], vec![150, 200])
        );
    }

    #[test]
    fn a_body_hides_what_is_behind_and_is_hidden_by_what_is_before() {
        let mut random = Random::new(1, 2);
        let mut scan = scan();
        let mut at = |scan: &mut Message<RadarScan>, range_m: f64| {
            edit(scan, |beam, returns| {
                if beam.azimuth_rad == 1.0 {
                    add_body(returns, range_m, 60.0, &mut random);
                }
            });
        };
        at(&mut scan, 5.0);
        assert_eq!(bins(&scan, 1), [100, 200]);
        at(&mut scan, 1.0);
        let found = bins(&scan, 1);
        assert_eq!(found, (59..=65).collect::<Vec<u16>>());
        assert_eq!(bins(&scan, 2), [100, 200]);
    }
}
