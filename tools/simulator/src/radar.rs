//! A rotating FMCW radar: antenna pattern, range response, speckle, noise, threshold.
//!
//! Every beam is measured from the robot's own pose at its instant. A beam is a fan of rays
//! weighted by the antenna pattern; each ray returns an echo from every wall that it meets or
//! passes, and one by way of its first mirror. A beam that meets rising ground returns clutter
//! from there. Echoes add as complex amplitudes with random phases, so that speckle is exponential
//! as on a real radar, and noise is complex with power 1 a bin: intensities are dB above noise.

use crate::caster::{Caster, Hit};
use crate::echo::Echo;
use crate::material::{Response, amplitude};
use crate::surface::{BeamSurface, SurfaceRecorder};
use crate::{Drive, Ground, Material, Random, RobotAttitude};
use nalgebra::Vector2;
use randt_geometry::Pose2;
use randt_geometry::elementary::{PI, exp, sin_cos};
use randt_messages::{Beam, Message, RadarScan, Return, SensorKind};

/// Rays of one beam's fan; one for every half degree of an iSDR-C beam's main lobe.
const RAYS: usize = 13;
/// The fan's half width in beam widths; the pattern has fallen by 33 dB there.
const FAN: f64 = 1.67;

/// Height of the radar over the ground under it.
const HEIGHT_M: f64 = 0.4;
/// Level of the ground under a grazing beam, against a perfect rough wall, dB: gravel and grass.
/// With its spread over many bins, single returns rise above the threshold up to some 7 m.
const GROUND_DB: f64 = -6.0;
/// The beam is high as well as wide: the ground's echo comes from this much before and behind the
/// point where its middle meets it, as factors on the range, and what stands behind is seen by its
/// upper half only.
const GROUND_SPREAD: [f64; 2] = [0.8, 1.3];
const BEHIND_GROUND: f64 = 0.5;
/// The ground's echo is a sum of this many.
const GROUND_ECHOES: u32 = 6;
/// Step of the search for the ground: relief is smoother than that.
const GROUND_STEP_M: f64 = 0.5;

/// What a radar is like. That many fields, because a sensor's data sheet has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarProfile {
    /// Its kind.
    pub sensor: SensorKind,
    /// Beams a turn.
    pub beams: u16,
    /// Time of a turn.
    pub period_ns: i64,
    /// Begin of the first sweep.
    pub offset_ns: i64,
    /// Largest error of a sweep's stamps, either way.
    pub stamp_error_ns: i64,
    /// Width of a range bin.
    pub bin_m: f64,
    /// Bins a beam.
    pub bins: u16,
    /// Intensity from which a return is kept, dB above noise.
    pub threshold_db: f64,
    /// Two-way width of the antenna pattern at -3 dB.
    pub beam_width_rad: f64,
    /// Level of a perfect rough wall at 1 m, dB above noise.
    pub level_db: f64,
    /// Fall of the level with range, dB a decade. A wall that fills the beam falls by 30; the
    /// receiver lifts far echoes by some of it.
    pub fall_db_decade: f64,
    /// Echo of the sensor's own cover: nearest bin, strongest bin, farthest bin.
    pub radome_bins: [u16; 3],
    /// Its level at the strongest bin and at the ends, dB above noise.
    pub radome_db: [f64; 2],
}

impl RadarProfile {
    /// indurad iSDR-C: 220 beams of 1.64 degrees at 5 Hz, 16.1 mm to 16 m. Widths and levels are
    /// fitted to the recording room.bag (tests/room.rs).
    pub fn isdr_c() -> Self {
        Self {
            sensor: SensorKind::IsdrC,
            beams: 220,
            period_ns: 200_000_000,
            offset_ns: 50_000_000,
            stamp_error_ns: 200_000,
            bin_m: 0.0161,
            bins: 994,
            threshold_db: 6.0,
            beam_width_rad: 0.037,
            level_db: 41.0,
            fall_db_decade: 24.0,
            radome_bins: [12, 19, 29],
            radome_db: [25.5, 11.5],
        }
    }

    /// Angle between beams.
    pub fn step_rad(&self) -> f64 {
        2.0 * PI / f64::from(self.beams.max(1))
    }
}

/// The radar. That many fields, because what is computed once or would be allocated anew for each
/// beam is kept.
#[derive(Clone, Debug)]
pub(crate) struct Radar {
    profile: RadarProfile,
    mounting: Pose2,
    caster: Caster,
    ground: Ground,
    random: Random,
    echo: Echo,
    fan: [(f64, f64); RAYS],
    responses: [Response; Material::ALL.len()],
    level: f64,
    hits: Vec<Hit>,
    mirrored: Vec<Hit>,
    /// Where a bench asks for them.
    surfaces: Option<SurfaceRecorder>,
    sequence: u64,
}

impl Radar {
    pub fn new(
        profile: RadarProfile,
        mounting: Pose2,
        caster: Caster,
        ground: Ground,
        seed: u64,
    ) -> Self {
        // Offsets in angle with the pattern's amplitude there; powers add up to 1.
        let fan = core::array::from_fn(|ray| {
            let offset = FAN * (2.0 * ray as f64 / (RAYS - 1) as f64 - 1.0);
            // 12 (offset / width)^2 dB down.
            let weight = amplitude(-12.0 * offset * offset);
            (offset * profile.beam_width_rad, weight)
        });
        let powers = fan.iter().map(|(_, weight): &(f64, f64)| weight * weight);
        let power: f64 = powers.sum();
        Self {
            mounting,
            caster,
            ground,
            random: Random::new(seed, 3),
            echo: Echo::new(&profile),
            fan: fan.map(|(offset, weight)| (offset, weight / power.sqrt())),
            responses: Material::ALL.map(Material::response),
            level: amplitude(profile.level_db),
            hits: Vec::new(),
            mirrored: Vec::new(),
            surfaces: None,
            sequence: 0,
            profile,
        }
    }

    /// From now on keeps which walls the latest sweep shows.
    pub fn record_surfaces(&mut self) {
        self.surfaces = Some(SurfaceRecorder::default());
    }

    /// Those walls, beam by beam; none where they are not recorded.
    pub fn surfaces(&self) -> &[BeamSurface] {
        self.surfaces
            .as_ref()
            .map_or(&[], SurfaceRecorder::surfaces)
    }

    /// The end of the next sweep.
    pub fn next_ns(&self) -> i64 {
        self.profile.offset_ns + (self.sequence as i64 + 1) * self.profile.period_ns
    }

    /// The next sweep. Stamps count from the start.
    pub fn sweep(&mut self, drive: &mut Drive) -> Message<RadarScan> {
        let profile = self.profile;
        let end_ns = self.next_ns();
        let begin_ns = end_ns - profile.period_ns;
        // The stamps of a sweep are wrong together.
        let error_ns = (self.random.between(-1.0, 1.0) * profile.stamp_error_ns as f64) as i64;
        let mut scan = Message::<RadarScan>::default();
        if let Some(surfaces) = &mut self.surfaces {
            surfaces.clear();
        }
        // More than a sweep of an iSDR-C has: no growing.
        scan.items.reserve(12_000);
        let head = &mut *scan.head;
        head.header.sequence = self.sequence;
        head.header.stamp_ns = end_ns + error_ns;
        head.sweep.begin_ns = begin_ns + error_ns;
        head.sweep.end_ns = end_ns + error_ns;
        head.sweep.sensor = profile.sensor as u32;
        head.sweep.beam_count = u32::from(profile.beams);
        head.sweep.range_resolution_m = profile.bin_m as f32;
        head.sweep.azimuth_step_rad = profile.step_rad() as f32;
        for (index, beam) in (0..profile.beams).zip(head.sweep.beams.iter_mut()) {
            // The middle of the beam's share of the turn.
            let share = (f64::from(index) + 0.5) / f64::from(profile.beams);
            let time_ns = begin_ns + (share * profile.period_ns as f64) as i64;
            let azimuth_rad = -PI + f64::from(index) * profile.step_rad();
            *beam = Beam {
                stamp_ns: time_ns + error_ns,
                azimuth_rad: azimuth_rad as f32,
                first_return: scan.items.len() as u32,
            };
            let state = drive.at(time_ns);
            let attitude = self.ground.attitude(&state);
            let seat = attitude.level(self.mounting.translation());
            let mounting = Pose2::new(seat.x, seat.y, self.mounting.yaw_rad);
            self.illuminate(&state.pose2().compose(&mounting), &attitude, azimuth_rad);
            let (bin_m, first) = (profile.bin_m, scan.items.len());
            self.echo.detect(&mut self.random, |bin, intensity| {
                scan.items.push(Return {
                    range_m: (f64::from(bin) * bin_m) as f32,
                    intensity,
                    beam: index,
                    bin,
                });
            });
            if let Some(surfaces) = &mut self.surfaces {
                let returns = scan.items.get(first..).unwrap_or_default();
                surfaces.end_beam(index, returns, &self.echo);
            }
        }
        self.sequence += 1;
        scan
    }

    /// A ray of a robot that stands so: its direction in the level plane, cosine and sine of its
    /// elevation.
    fn ray(
        &self,
        radar: &Pose2,
        attitude: &RobotAttitude,
        azimuth_rad: f64,
    ) -> (Vector2<f64>, f64, f64) {
        let mounted_rad = self.mounting.yaw_rad;
        let (azimuth_rad, cos_elevation, sin_elevation) = if attitude.is_level() {
            (azimuth_rad, 1.0, 0.0)
        } else {
            let (level_rad, cos, sin) = attitude.ray(mounted_rad + azimuth_rad);
            (level_rad - mounted_rad, cos, sin)
        };
        let (sin, cos) = sin_cos(radar.yaw_rad + azimuth_rad);
        (Vector2::new(cos, sin), cos_elevation, sin_elevation)
    }

    /// Adds the echoes of one beam. Ranges along the level plane are `hit.range_m`, the radar's
    /// own are longer.
    fn illuminate(&mut self, radar: &Pose2, attitude: &RobotAttitude, azimuth_rad: f64) {
        let origin = radar.translation();
        let range_max_m = f64::from(self.profile.bins) * self.profile.bin_m;
        let ground_m = self.clutter(radar, attitude, azimuth_rad);
        for (offset_rad, weight) in self.fan {
            let (direction, cos_elevation, _) = self.ray(radar, attitude, azimuth_rad + offset_rad);
            let level_max_m = range_max_m * cos_elevation;
            (self.caster).cast(origin, direction, level_max_m, &mut self.hits);
            let mut amplitude = weight * self.level;
            for index in 0..self.hits.len() {
                let Some(hit) = self.hits.get(index).copied() else {
                    break;
                };
                let response = self.response(hit.material);
                let seen = match hit.range_m > ground_m {
                    true => BEHIND_GROUND,
                    false => 1.0,
                };
                let strength = seen * amplitude * reflect(&response, hit.cos_incidence);
                let range_m = hit.range_m / cos_elevation;
                self.add_echo(range_m, strength, Some(hit.normal));
                if index == 0 {
                    let point = origin + direction * hit.range_m;
                    let amplitude = seen * amplitude * response.mirror;
                    self.mirror(point, direction, &hit, amplitude, cos_elevation);
                }
                amplitude *= response.through;
            }
        }
    }

    /// Adds an echo; with the normal of the wall that it comes straight from.
    fn add_echo(&mut self, range_m: f64, amplitude: f64, normal: Option<Vector2<f64>>) {
        self.echo.add(&mut self.random, range_m, amplitude);
        if let Some(surfaces) = &mut self.surfaces {
            surfaces.add(range_m, amplitude, normal);
        }
    }

    /// Adds the ground's echo where the beam's middle meets it; how far off that is in the level
    /// plane, infinite where the beam stays above.
    fn clutter(&mut self, radar: &Pose2, attitude: &RobotAttitude, azimuth_rad: f64) -> f64 {
        if attitude.is_level() {
            return f64::INFINITY;
        }
        let (direction, cos_elevation, sin_elevation) = self.ray(radar, attitude, azimuth_rad);
        let range_max_m = f64::from(self.profile.bins) * self.profile.bin_m;
        let origin = radar.translation();
        let height_m = |point: Vector2<f64>| self.ground.at(point).height_m;
        let start_m = height_m(origin) + HEIGHT_M;
        let above_m = |range_m: f64| {
            start_m + range_m * sin_elevation / cos_elevation
                - height_m(origin + direction * range_m)
        };
        let (mut near_m, mut clear_m) = (0.0, HEIGHT_M);
        let ground_m = loop {
            let far_m = near_m + GROUND_STEP_M;
            if far_m > range_max_m {
                return f64::INFINITY;
            }
            let above = above_m(far_m);
            if above < 0.0 {
                break near_m + GROUND_STEP_M * clear_m / (clear_m - above);
            }
            (near_m, clear_m) = (far_m, above);
        };
        let strength = self.level * amplitude(GROUND_DB) / f64::from(GROUND_ECHOES).sqrt();
        let [nearest, farthest] = GROUND_SPREAD;
        for _ in 0..GROUND_ECHOES {
            let range_m = ground_m / cos_elevation * self.random.between(nearest, farthest);
            self.add_echo(range_m, strength, None);
        }
        ground_m
    }

    /// Adds what a ray sees in its first wall as in a mirror: there and back by the same way.
    fn mirror(
        &mut self,
        point: Vector2<f64>,
        direction: Vector2<f64>,
        hit: &Hit,
        amplitude: f64,
        cos_elevation: f64,
    ) {
        let response = self.response(hit.material);
        // Twice over the mirror; and the nearest echo, 10 dB down for the missing share of the
        // fan.
        let onward = direction + hit.normal * (2.0 * hit.cos_incidence);
        let range_max_m = f64::from(self.profile.bins) * self.profile.bin_m;
        let rest_m = range_max_m * cos_elevation - hit.range_m;
        if rest_m <= 0.0 {
            return;
        }
        self.caster.cast(point, onward, rest_m, &mut self.mirrored);
        if let Some(second) = self.mirrored.first().copied() {
            let strength = amplitude
                * response.mirror
                * reflect(&self.response(second.material), second.cos_incidence);
            let range_m = (hit.range_m + second.range_m) / cos_elevation;
            self.add_echo(range_m, strength, None);
        }
    }

    fn response(&self, material: Material) -> Response {
        // The array has one entry for each of `Material::ALL`, which is in the order of
        // declaration.
        let response = self.responses.get(material as usize).copied();
        response.unwrap_or_else(|| material.response())
    }
}

/// Amplitude of a wall's echo under an angle of incidence.
fn reflect(response: &Response, cos_incidence: f64) -> f64 {
    let rough = response.diffuse * cos_incidence;
    let offset =
        (1.0 - cos_incidence * cos_incidence) / (response.specular_width * response.specular_width);
    // exp(-7) is 60 dB down; most walls are hit far from their normal.
    if offset > 7.0 {
        rough
    } else {
        rough + response.specular * exp(-offset)
    }
}
