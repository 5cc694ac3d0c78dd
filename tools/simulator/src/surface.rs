//! The wall that each beam of a sweep shows: what a bench asks for, and no log has.

use crate::echo::Echo;
use nalgebra::Vector2;
use randt_messages::Return;

/// A wall's share of a return's power has to be this large for the return to be the wall's: the
/// rest is ghosts and the ground.
const SHARE_MIN: f64 = 0.5;

/// A beam whose strongest return off a wall came straight from there, neither by way of a mirror
/// nor from the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamSurface {
    /// Index of the beam in its sweep.
    pub beam: u16,
    /// The wall's unit normal in the world, towards the radar.
    pub normal: Vector2<f64>,
}

/// One echo of the beam at hand.
#[derive(Clone, Copy, Debug)]
struct EchoOrigin {
    range_m: f64,
    amplitude: f64,
    /// The wall's; none of a ghost or the ground.
    normal: Option<Vector2<f64>>,
}

/// Collects them, beam by beam, without drawing random numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct SurfaceRecorder {
    echoes: Vec<EchoOrigin>,
    returns: Vec<Return>,
    surfaces: Vec<BeamSurface>,
}

impl SurfaceRecorder {
    /// Those of the latest sweep, in order of their beams.
    pub fn surfaces(&self) -> &[BeamSurface] {
        &self.surfaces
    }

    /// A sweep begins.
    pub fn clear(&mut self) {
        self.surfaces.clear();
    }

    /// An echo of the beam at hand, as [`Echo::add`] gets it.
    pub fn add(&mut self, range_m: f64, amplitude: f64, normal: Option<Vector2<f64>>) {
        self.echoes.push(EchoOrigin {
            range_m,
            amplitude,
            normal,
        });
    }

    /// The beam at hand ends, with these returns.
    pub fn end_beam(&mut self, beam: u16, returns: &[Return], echo: &Echo) {
        self.returns.clear();
        self.returns.extend_from_slice(returns);
        self.returns
            .sort_by(|a, b| b.intensity.total_cmp(&a.intensity));
        let normals = self.returns.iter().map(|one| self.wall(one.bin, echo));
        if let Some(normal) = normals.flatten().next() {
            self.surfaces.push(BeamSurface { beam, normal });
        }
        self.echoes.clear();
    }

    /// The normal of the wall that a return comes from. Rays that meet one rough wall have
    /// several: it is that of the strongest.
    fn wall(&self, bin: u16, echo: &Echo) -> Option<Vector2<f64>> {
        let (mut all, mut walls, mut strongest) = (0.0, 0.0, (0.0, None));
        for origin in &self.echoes {
            let power = echo.power(origin.range_m, origin.amplitude, bin);
            all += power;
            if origin.normal.is_some() {
                walls += power;
                if power > strongest.0 {
                    strongest = (power, origin.normal);
                }
            }
        }
        let is_wall = walls >= echo.threshold() && walls >= SHARE_MIN * all;
        strongest.1.filter(|_| is_wall)
    }
}

#[cfg(test)]
mod tests {
    use crate::{BeamSurface, Event, Robot, Simulation, World};

    const SCANS: u64 = 12;

    /// The surfaces of a drive's last sweep.
    fn surfaces(text: &str) -> Vec<BeamSurface> {
        let world = World::parse("test", text).unwrap();
        let robot = Robot::for_world(&world);
        let mut drive = Simulation::new(&world, robot, SCANS, 1).with_surfaces();
        for event in drive.by_ref() {
            drop(event);
        }
        drive.surfaces().to_vec()
    }

    #[test]
    fn a_beam_shows_the_wall_that_it_meets_and_none_out_of_sight() {
        // The radar sees 16 m: one wall at 5 m, the other one out of sight.
        let found =
            surfaces("wall concrete -9,5 9,5\nwall concrete -9,-17 9,-17\nroute 0,0 4,0 4,1");
        assert!((40..110).contains(&found.len()), "{}", found.len());
        for surface in &found {
            assert!(surface.normal.y < -0.999, "{surface:?}");
        }
        let order = found.windows(2).all(|pair| pair[0].beam < pair[1].beam);
        assert!(order);
    }

    #[test]
    fn what_a_mirror_shows_is_no_wall() {
        // The metal wall at 2 m shows the concrete at -3 m again, 7 m off behind it: no beam of
        // the right half plane may have the concrete's normal.
        let found = surfaces("wall metal 2,-9 2,9\nwall concrete -3,-9 -3,9\nroute 0,0 0,4 1,4");
        let ahead = |surface: &&BeamSurface| surface.normal.x < -0.999;
        let behind = |surface: &&BeamSurface| surface.normal.x > 0.999;
        assert!(found.iter().filter(ahead).count() > 40);
        assert!(found.iter().filter(behind).count() > 40);
        // The robot looks along y: beams clockwise of that, the first half of the sweep, see the
        // metal.
        assert!(
            found.iter().filter(behind).all(|it| it.beam >= 108),
            "{found:?}"
        );
    }

    #[test]
    fn asking_for_surfaces_changes_no_bit() {
        let world = World::building();
        let drive = || Simulation::new(&world, Robot::default(), 3, 7);
        let scans = |drive: Simulation| -> Vec<_> {
            let scan = |event| match event {
                Event::Scan(scan) => Some(scan.items),
                _ => None,
            };
            drive.filter_map(scan).collect()
        };
        assert_eq!(scans(drive()), scans(drive().with_surfaces()));
    }
}
