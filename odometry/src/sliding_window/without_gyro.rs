//! Whether the window's scans fit without the gyro.

use super::{SlidingWindow, WindowScan, solver::Solution};
use crate::submaps::Submap;
use randt_config::Config;
use randt_geometry::elementary::wrap;
use randt_messages::Localizability as Seen;

/// The newest scans that have to fit without the gyro.
const FITTING_SCANS: usize = 3;
/// By how much the window turns differently without it, rad (1.5 degrees): where it is not the
/// gyro that is wrong, it was 0.2 to 1.1 degrees, under a wrong one 3 to 30.
const DIFFERS_MIN_RAD: f64 = 0.026;

impl SlidingWindow {
    /// Tries whether the window's scans fit without the gyro: their states are estimated anew, one
    /// after the other, from the oldest on. `None`, and all as it was, where the newest do not fit,
    /// one does not see every direction, they turn as they did with it, or the frame's first scan
    /// is among them.
    pub fn solve_without_gyro(
        &mut self,
        submap: &Submap,
        fit_min: f64,
        config: &Config,
    ) -> Option<Solution> {
        if self.holds_first_scan() {
            return None;
        }
        let used = self.used;
        let mut tried = self.scans.get(..used)?.to_vec();
        std::mem::swap(&mut self.scans, &mut tried);
        let fits = self.solve_scan_by_scan(submap, config).is_some() && self.fits(fit_min);
        let without_rad = self.turned_rad();
        std::mem::swap(&mut self.scans, &mut tried);
        self.used = used;
        let differs = wrap(self.turned_rad() - without_rad).abs() > DIFFERS_MIN_RAD;
        if !(fits && differs) {
            return None;
        }
        for (i, tried) in tried.into_iter().enumerate() {
            let scan = self.scans.get_mut(i)?;
            scan.drop_gyro();
            scan.state = tried.state;
            self.deskew(i, None, config);
            self.build_cells(i, submap);
        }
        self.solve(submap, config)
    }

    /// Estimates the states without the gyro, each scan predicted by the one before.
    fn solve_scan_by_scan(&mut self, submap: &Submap, config: &Config) -> Option<Solution> {
        let scans = self.used;
        self.scans.iter_mut().for_each(WindowScan::drop_gyro);
        let mut solution = None;
        for newest in 1..scans {
            self.used = newest + 1;
            let last = self.scans.get(newest - 1)?.state;
            let scan = self.scans.get_mut(newest)?;
            scan.state = last.after(scan.dt_s);
            self.deskew(newest, None, config);
            self.build_cells(newest, submap);
            solution = self.solve(submap, config);
        }
        solution
    }

    /// How far the robot has turned in the window.
    fn turned_rad(&self) -> f64 {
        let ends = self.oldest().zip(self.newest());
        ends.map_or(0.0, |(oldest, newest)| {
            let (from, to) = (oldest.state.odom_from_base, newest.state.odom_from_base);
            from.between(&to).yaw_rad
        })
    }

    /// Whether the newest scans fit, and all see every direction.
    fn fits(&self, fit_min: f64) -> bool {
        let used = self.scans.iter().take(self.used);
        let mut solved = used.clone().skip(1);
        let mut newest = used.rev().take(FITTING_SCANS);
        newest.all(|scan| scan.fit() > fit_min)
            && solved.all(|scan| scan.localizability.seen == Seen::Full)
    }
}
