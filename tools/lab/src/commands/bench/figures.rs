//! The figures of one drive: each defined once, with what is better and how it is shown.

/// Which way a figure is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Better {
    /// The smaller the better.
    Less,
    /// The larger the better.
    More,
    /// It only describes.
    Neither,
}

/// A column of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    /// Its head, with the unit.
    pub name: &'static str,
    /// Which way it is better.
    pub better: Better,
    /// Digits behind the point.
    pub decimals: usize,
}

macro_rules! figures {
    ($($(#[$doc:meta])* $name:ident: $better:ident, $decimals:literal;)*) => {
        /// What one drive gave; none where a figure is not defined for it. That many fields,
        /// because each is a column of the file.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub(super) struct Figures {
            $($(#[$doc])* pub $name: Option<f64>,)*
        }

        /// The columns, in order.
        pub(super) const COLUMNS: &[Column] = &[
            $(Column {
                name: stringify!($name),
                better: Better::$better,
                decimals: $decimals,
            },)*
        ];

        impl Figures {
            /// By name, as the columns are called; none where there is no such column.
            pub fn get(&self, name: &str) -> Option<f64> {
                match name {
                    $(stringify!($name) => self.$name,)*
                    _ => None,
                }
            }

            /// Sets one by name; a column that is not known any more is left out.
            pub fn set(&mut self, name: &str, value: Option<f64>) {
                match name {
                    $(stringify!($name) => self.$name = value,)*
                    _ => {}
                }
            }
        }
    };
}

figures! {
    /// Duration of the drive.
    duration_s: Neither, 1;
    /// True path.
    path_m: Neither, 1;
    /// Silent metres.
    silent_m: Less, 0;
    /// Windows that are wrong, believed or not.
    wrong_m: Less, 0;
    /// Largest error over 10 s of good trust.
    worst_good_10s_m: Less, 3;
    /// Largest error of the heading under good trust, since its frame's start.
    heading_deg: Less, 1;
    /// Accepted loops.
    loops: More, 0;
    /// Of those, false ones.
    false_loops: Less, 0;
    /// Share of the revisits that were recognised.
    recall: More, 3;
    /// Odometry frames.
    frames: Less, 0;
    /// Components of the map at the end beside the first one.
    unjoined: Less, 0;
    /// Share of the scans that are held.
    held: Neither, 4;
    /// Share of all scans that are good.
    good: More, 4;
    /// Share of the held scans that are good.
    good_of_held: More, 4;
    /// Changes of trust a minute.
    changes_per_min: Less, 2;
    /// NEES over ten scans: mean, median, share inside 95 %.
    nees_mean: Neither, 2;
    /// Its median.
    nees_median: Neither, 2;
    /// Share of the errors inside 95 %.
    nees_inside: Neither, 4;
    /// Its mean where the robot drives ahead.
    nees_straight: Neither, 2;
    /// Its mean where the robot turns.
    nees_turn: Neither, 2;
    /// Its mean at standstill.
    nees_standstill: Neither, 2;
    /// NEES of the map's keyframes seen from its first one, at the end.
    map_nees: Neither, 2;
    /// Share of them inside 95 %.
    map_inside: Neither, 4;
    /// The same of the heading alone, which is 1 where its variance is right.
    map_yaw_nees: Neither, 2;
    /// NEES over 200 random pairs of keyframes.
    map_pairs_nees: Neither, 2;
    /// Share of them inside 95 %.
    map_pairs_inside: Neither, 4;
    /// Seconds from the fault's onset until trust was not good; none where that did not come.
    flagged_s: Less, 1;
    /// Seconds from the fault's end until trust was good again; likewise.
    good_again_s: Less, 1;
    /// Seconds from the fault's onset, or the drive's begin, until the live pose was off by over 1
    /// degree or 0.2 m since then; none where it never was.
    effect_s: Neither, 1;
    /// The same until the IMU's fault was in words; without a fault an alarm.
    named_s: Neither, 1;
    /// Degenerate stretches.
    stretches: Neither, 0;
    /// Of those, the ones that were flagged later than 1 s or 1 m after the last scan with an end
    /// wall in sight.
    stretches_late: Less, 0;
    /// The slowest: seconds from that scan until trust was not good, or until it is held again.
    stretch_flagged_s: Less, 1;
    /// The same in metres.
    stretch_flagged_m: Less, 2;
    /// Nine of ten scans of stretches, where a direction is named: how far it is off the weaker
    /// one.
    direction_deg: Less, 1;
    /// Share of the positions in stretches inside the ellipse of 95 %, from that scan on.
    stretch_inside: Neither, 3;
    /// The ellipse's semi-axis at the ends of stretches over the error there, both as RMS.
    stretch_axis_per_error: Neither, 2;
    /// Nine of ten stretches: error at the first good scan behind them, since that scan.
    stretch_return_m: Less, 3;
    /// Nine of ten stretches: seconds from the first held scan until trust was good.
    stretch_good_again_s: Less, 1;
    /// RMSE of the live positions after alignment.
    live_ate_m: Less, 3;
    /// RMSE of the final positions after alignment.
    final_ate_m: Less, 3;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_is_found_by_its_name() {
        let mut figures = Figures::default();
        for (index, column) in COLUMNS.iter().enumerate() {
            assert_eq!(figures.get(column.name), None);
            figures.set(column.name, Some(index as f64));
            assert_eq!(figures.get(column.name), Some(index as f64));
        }
        figures.set("of_an_earlier_build", Some(1.0));
        assert_eq!(figures.get("of_an_earlier_build"), None);
        assert_eq!(figures.silent_m, Some(2.0));
    }
}
