//! Messages of ROS become ours.

use super::RosSource;
use super::decoded::Decoded;
use crate::limit::is_misread;
use crate::polar_image::{PolarImage, RangeBins, build};
use crate::ros::imu::RosImu;
use crate::ros::wire::RosHeader;
use crate::ros::{Cloud, UNKNOWN_INTENSITY};
use crate::sweep::Polar;
use crate::{Error, Event};
use randt_messages::{Header, ImuSample, Return, Twist};

/// Gives returns without intensity one that falls along each beam, and is above every threshold:
/// the filter takes what a beam meets first, with what follows it.
fn rank_by_range(items: &mut [Return]) {
    for beam in items.chunk_by_mut(|a, b| a.beam == b.beam) {
        for (rank, item) in beam.iter_mut().enumerate() {
            // Two steps of single precision apart, and above the threshold for 65,535 returns.
            item.intensity = 2.0 * UNKNOWN_INTENSITY - rank as f32;
        }
    }
}

impl RosSource {
    /// The event that a message is; `None` where it is left out and counted.
    pub(super) fn event(
        &mut self,
        decoded: Decoded,
        arrival_ns: i64,
    ) -> Result<Option<Event>, Error> {
        Ok(match decoded {
            Decoded::Cloud(cloud) => self.sweep(&cloud),
            Decoded::Polar(header, image) => Some(self.polar_sweep(&header, image)?),
            Decoded::Imu(imu) => self.sample(&imu, arrival_ns),
            Decoded::Twist(twist) => {
                let header = Header {
                    sequence: self.twists,
                    stamp_ns: twist.header.stamp_ns,
                    ..Header::default()
                };
                self.twists += 1;
                Some(Event::Twist(Twist {
                    header,
                    arrival_ns,
                    velocity: twist.velocity,
                    covariance: twist.covariance,
                }))
            }
            Decoded::Transforms(_) => None,
        })
    }

    fn sweep(&mut self, cloud: &Cloud) -> Option<Event> {
        let (polar, without_direction) = Polar::from_cloud(cloud, self.mirrored);
        let counters = &mut self.counters;
        let first = || "a return at range 0 has no direction".to_owned();
        counters.count_event("returns_at_range_zero", without_direction.into(), first);
        let stamp_ns = cloud.header.stamp_ns;
        let first = || format!("a NaN or infinite value in the sweep stamped {stamp_ns}");
        counters.count_event("returns_not_finite", cloud.not_finite.into(), first);
        let mut scan = self.turn.as_ref()?.build(polar, self.sweeps, counters);
        if cloud.without_intensity.is_some() {
            rank_by_range(&mut scan.items);
        }
        self.sweeps += 1;
        Some(Event::Scan(scan))
    }

    fn polar_sweep(&mut self, header: &RosHeader, mut image: PolarImage) -> Result<Event, Error> {
        let Some(size_m) = self.bin_m else {
            return Err(Error::BinSize {
                path: self.path.clone(),
                bins: image.bins(),
            });
        };
        if !image.has_times() {
            let (begin_ns, end_ns) = self.options.stamp.interval(header.stamp_ns, self.period_ns);
            image.set_interval(begin_ns, end_ns);
        }
        let bins = RangeBins {
            size_m,
            offset_m: self.navtech.map_or(0.0, |navtech| navtech.offset_m),
        };
        let (scan, over) = build(&image, bins, self.options.power_min, self.sweeps);
        self.sweeps += 1;
        let (counters, stamp_ns) = (&mut self.counters, header.stamp_ns);
        let lost = u64::from(scan.head.sweep.beams_lost);
        let first = || format!("in the sweep stamped {stamp_ns}");
        counters.count_loss("beams_lost", lost, first);
        let first = || {
            format!(
                "in the sweep stamped {stamp_ns}: the strongest are kept (a higher --power-min leaves fewer)"
            )
        };
        counters.count_loss("returns_over_limit", over as u64, first);
        Ok(Event::Scan(scan))
    }

    fn sample(&mut self, imu: &RosImu, arrival_ns: i64) -> Option<Event> {
        let stamp_ns = imu.header.stamp_ns;
        let (rate_rad_s, acceleration_m_s2) = (imu.rate_rad_s, imu.acceleration_m_s2);
        if is_misread(
            &mut self.counters,
            stamp_ns,
            &rate_rad_s,
            &acceleration_m_s2,
        ) {
            return None;
        }
        let header = Header {
            sequence: self.samples,
            stamp_ns,
            ..Header::default()
        };
        self.samples += 1;
        Some(Event::Imu(ImuSample {
            header,
            device_ns: stamp_ns,
            arrival_ns,
            rate_rad_s,
            acceleration_m_s2,
        }))
    }
}
