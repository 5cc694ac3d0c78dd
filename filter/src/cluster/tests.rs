//! The filter on hand-made beams, on broken input, and laid out in other memory.

use super::*;
use proptest::prelude::*;

fn filter() -> ClusterFilter {
    ClusterFilter::new(&Default::default(), &Default::default())
}

/// A sweep of these beams, each a list of (range, intensity).
fn sweep(beams: &[&[(f32, f32)]]) -> Message<RadarScan> {
    let mut scan = Message::<RadarScan>::default();
    scan.head.sweep.beam_count = beams.len() as u32;
    for (index, beam) in beams.iter().enumerate() {
        scan.head.sweep.beams[index].first_return = scan.items.len() as u32;
        scan.items
            .extend(beam.iter().map(|&(range_m, intensity)| Return {
                range_m,
                intensity,
                beam: index as u16,
                bin: 0,
            }));
    }
    scan
}

fn filtered(scan: &Message<RadarScan>) -> Message<RadarPoints> {
    let mut points = Message::default();
    filter().process(scan.as_ref(), &mut points);
    points
}

fn kept(beam: &[(f32, f32)]) -> Vec<(f32, f32)> {
    let points = filtered(&sweep(&[beam]));
    points
        .items
        .iter()
        .map(|p| (p.range_m, p.intensity))
        .collect()
}

#[test]
fn the_strongest_with_both_flanks_is_kept() {
    let beam = [
        (2.00, 9.0),
        (2.02, 8.0),
        (2.04, 12.0),
        (2.06, 20.0),
        (2.08, 11.0),
        (2.10, 7.0),
        (2.12, 9.0),
    ];
    assert_eq!(kept(&beam), beam[1..6]);
}

#[test]
fn a_gap_ends_the_cluster_on_either_side() {
    let beam = [
        (2.00, 9.0),
        (2.05, 12.0),
        (2.07, 20.0),
        (2.09, 11.0),
        (2.14, 7.0),
    ];
    assert_eq!(kept(&beam), beam[1..4]);
}

#[test]
fn equal_neighbours_end_the_cluster_and_the_nearest_of_equal_peaks_wins() {
    let beam = [(2.00, 12.0), (2.02, 12.0), (2.04, 8.0)];
    assert_eq!(kept(&beam), beam[..1]);
}

#[test]
fn the_flanks_below_the_threshold_and_beyond_the_limits_are_left_out() {
    let beam = [
        (0.59, 50.0),
        (0.61, 30.0),
        (0.63, 40.0),
        (0.65, 6.0),
        (0.67, 5.0),
    ];
    assert_eq!(kept(&beam), beam[1..3]);
    assert_eq!(kept(&[(16.0, 50.0), (3.0, 6.0)]), []);
}

#[test]
fn every_beam_counts_even_the_last_and_the_table_is_indexed_anew() {
    let mut scan = sweep(&[
        &[(2.00, 5.0), (2.02, 9.0)],
        &[],
        &[(3.0, 9.0), (3.02, 8.0), (9.0, 7.0)],
        &[(4.0, 9.0)],
    ]);
    scan.head.header.sequence = 7;
    scan.head.header.stamp_ns = 9_000;
    scan.head.sweep.beams[2].stamp_ns = 8_000;
    scan.head.sweep.beams_lost = 3;
    let points = filtered(&scan);
    let firsts: Vec<u32> = points
        .head
        .sweep
        .beams()
        .iter()
        .map(|b| b.first_return)
        .collect();
    assert_eq!(firsts, [0, 1, 1, 3]);
    assert_eq!(points.items.len(), 4);
    assert_eq!(points.items[3].beam, 3);
    assert_eq!(
        (points.head.scan_sequence, points.head.header.stamp_ns),
        (7, 9_000)
    );
    assert_eq!(points.head.sweep.beams[2].stamp_ns, 8_000);
    assert_eq!(points.head.sweep.beams_lost, 3);
}

#[test]
fn own_messages_are_counted() {
    let mut filter = filter();
    let mut points = Message::default();
    for sequence in 0..3 {
        filter.process(sweep(&[&[(2.0, 9.0)]]).as_ref(), &mut points);
        assert_eq!(points.head.header.sequence, sequence);
        assert_eq!(points.items.len(), 1);
    }
}

#[test]
fn what_is_laid_out_in_other_memory_is_the_same_message() {
    let scan = sweep(&[
        &[(2.00, 7.0), (2.02, 9.0)],
        &[],
        &[(3.0, 9.0), (3.02, 8.0), (9.0, 7.0)],
    ]);
    let message = filtered(&scan);
    let mut filter = filter();
    let laid_out = filter.filter(scan.as_ref());
    let mut head = PointsHead::default();
    let mut items = vec![Return::default(); laid_out.len];
    laid_out.write_head(&mut head);
    laid_out.write_items(&mut items);
    assert!(laid_out.len > 0);
    assert_eq!((head, items), (*message.head, message.items));
}

#[test]
fn values_that_are_not_finite_cost_only_themselves() {
    let nan = f32::NAN;
    let beam = [
        (1.0, f32::INFINITY),
        (nan, 50.0),
        (2.00, nan),
        (2.02, 9.0),
        (nan, 8.0),
        (2.06, 7.0),
    ];
    assert_eq!(kept(&beam), beam[3..4]);
}

proptest! {
    #[test]
    fn broken_tables_and_values_give_each_return_at_most_once(
        firsts in prop::collection::vec(0_u32..200, 0..40),
        beam_count in 0_u32..2 * MAX_BEAMS as u32,
        values in prop::collection::vec((0.0_f32..20.0, 0.0_f32..30.0), 0..150),
    ) {
        let mut scan = sweep(&[&values]);
        scan.head.sweep.beam_count = beam_count;
        for (beam, first) in scan.head.sweep.beams.iter_mut().zip(&firsts) {
            beam.first_return = *first;
        }
        for (bin, r) in scan.items.iter_mut().enumerate() {
            r.bin = bin as u16;
        }
        let points = filtered(&scan);
        prop_assert!(points.items.windows(2).all(|w| w[0].bin < w[1].bin));
        let mut seen = 0;
        for beam in 0..points.head.sweep.beams().len() {
            let range = points.head.sweep.returns_of(beam, points.items.len());
            prop_assert_eq!(range.start, seen);
            seen = range.end;
            prop_assert!(points.items[range].iter().all(|p| p.beam as usize == beam));
        }
        prop_assert!(points.head.sweep.beams().is_empty() || seen == points.items.len());
    }
}
