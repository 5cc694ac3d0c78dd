//! The world `building`: one floor of an office building, 30 m by 20 m.
//!
//! A corridor runs around a core that a second corridor crosses; rooms with furniture lie on both sides.
//! The route goes through corridors and three rooms and closes after about 75 m.

use crate::{Material::*, World};
use nalgebra::Vector2;

impl World {
    /// The world `building`.
    pub fn building() -> Self {
        let mut world = Self {
            name: "building".to_owned(),
            walls: Vec::new(),
            route_m: route(),
        };
        shell(&mut world);
        partitions(&mut world);
        furniture(&mut world);
        world
    }
}

/// Outer walls: concrete with windows.
fn shell(world: &mut World) {
    for (from, to) in [
        ([0.0, 0.0], [30.0, 0.0]),
        ([30.0, 0.0], [30.0, 20.0]),
        ([30.0, 20.0], [0.0, 20.0]),
        ([0.0, 20.0], [0.0, 0.0]),
    ] {
        let (start, end) = (Vector2::<f64>::from(from), Vector2::from(to));
        // Bays of 5 m: 1.6 m wall, 1.8 m window, 1.6 m wall.
        let bays = ((end - start).norm() / 5.0).round();
        let step = (end - start) / bays;
        let mut bay = start;
        for _ in 0..bays as usize {
            let at = |fraction: f64| <[f64; 2]>::from(bay + step * fraction);
            world.wall(at(0.0), at(0.32), Concrete);
            world.wall(at(0.32), at(0.68), Glass);
            world.wall(at(0.68), at(1.0), Concrete);
            bay += step;
        }
    }
}

fn partitions(world: &mut World) {
    // The corridor's outer side.
    let south = [
        (6.6, 7.6),
        (9.0, 10.0),
        (13.0, 14.0),
        (18.0, 19.0),
        (23.4, 24.4),
    ];
    world.wall_with_doors([0.0, 5.0], [30.0, 5.0], Plaster, &south);
    let north = [(5.6, 6.6), (11.0, 12.0), (17.0, 18.0), (23.4, 24.4)];
    world.wall_with_doors([0.0, 15.0], [30.0, 15.0], Plaster, &north);
    world.wall_with_doors([5.0, 5.0], [5.0, 15.0], Plaster, &[(4.5, 5.5)]);
    world.wall_with_doors(
        [25.0, 5.0],
        [25.0, 15.0],
        Plaster,
        &[(2.0, 3.0), (7.0, 8.0)],
    );
    // The core: two blocks with the crossing corridor between them.
    world.wall_with_doors([7.2, 7.2], [14.0, 7.2], Concrete, &[(4.0, 5.0)]);
    world.wall([7.2, 12.8], [14.0, 12.8], Plaster);
    world.wall([7.2, 7.2], [7.2, 12.8], Concrete);
    world.wall_with_doors([14.0, 7.2], [14.0, 12.8], Plaster, &[(3.5, 4.5)]);
    world.wall([16.0, 7.2], [22.8, 7.2], Plaster);
    world.wall_with_doors([16.0, 12.8], [22.8, 12.8], Plaster, &[(2.0, 3.0)]);
    world.wall([22.8, 7.2], [22.8, 12.8], Concrete);
    world.wall([16.0, 7.2], [16.0, 12.8], Concrete);
    // Between rooms.
    for x in [8.0, 15.0, 22.0] {
        world.wall([x, 0.0], [x, 5.0], Plaster);
    }
    for x in [10.0, 19.0] {
        world.wall([x, 15.0], [x, 20.0], Plaster);
    }
    // Doors that stand open into their rooms, and one that is closed.
    world.wall([9.0, 5.0], [8.9, 4.0], Wood);
    world.wall([14.0, 5.0], [14.2, 4.05], Wood);
    world.wall([11.0, 15.0], [10.7, 15.95], Wood);
    world.wall([18.0, 15.0], [18.9, 15.3], Wood);
    world.wall([25.0, 7.0], [26.0, 6.9], Wood);
    world.wall([18.0, 5.0], [19.0, 5.0], Wood);
}

fn furniture(world: &mut World) {
    // Corridor: lockers, a fire-hose cabinet, a copier, pillars, a vending machine.
    world.block([16.2, 6.75], [1.8, 0.45], Metal);
    world.block([20.0, 5.0], [0.5, 0.2], Metal);
    world.block([8.2, 13.0], [0.9, 0.5], Wood);
    world.block([5.0, 11.6], [0.35, 0.35], Concrete);
    world.block([24.65, 10.0], [0.35, 0.35], Concrete);
    world.block([13.4, 14.65], [0.35, 0.35], Concrete);
    world.block([19.6, 14.3], [0.9, 0.7], Metal);
    world.block([7.2, 8.6], [0.25, 0.8], Metal);
    world.block([14.0, 9.0], [0.3, 0.6], Wood);
    // Radiators under windows.
    for x in [2.0, 9.6, 12.2, 17.0, 26.8] {
        world.block([x, 0.1], [1.2, 0.1], Metal);
        world.block([x, 19.8], [1.2, 0.1], Metal);
    }
    for y in [7.0, 12.0] {
        world.block([0.1, y], [0.1, 1.2], Metal);
        world.block([29.8, y], [0.1, 1.2], Metal);
    }
    // South rooms: desks and shelves.
    world.block([8.0, 1.0], [0.4, 1.6], Metal);
    world.block([12.9, 0.7], [1.6, 0.8], Wood);
    world.block([10.3, 0.6], [0.5, 0.5], Wood);
    world.block([2.0, 1.8], [1.6, 0.8], Wood);
    world.block([4.4, 3.9], [1.2, 0.4], Metal);
    world.block([17.2, 1.4], [2.4, 1.0], Wood);
    world.block([25.0, 1.5], [1.6, 0.8], Wood);
    world.block([28.6, 3.0], [0.6, 1.6], Metal);
    // East room.
    world.block([28.5, 9.2], [0.8, 1.6], Wood);
    world.block([25.2, 9.4], [0.4, 1.2], Metal);
    world.block([27.6, 13.9], [1.8, 0.5], Metal);
    world.block([28.9, 5.4], [0.5, 0.9], Wood);
    // North rooms.
    world.block([13.6, 18.6], [2.0, 0.9], Wood);
    world.block([10.2, 17.6], [0.4, 1.8], Metal);
    world.block([14.2, 15.2], [1.4, 0.4], Metal);
    world.block([2.2, 17.0], [1.6, 0.8], Wood);
    world.block([7.6, 16.0], [0.4, 1.8], Metal);
    world.block([21.8, 17.2], [2.0, 1.0], Wood);
    // West room and core.
    world.block([1.6, 7.6], [0.8, 1.8], Wood);
    world.block([2.4, 12.6], [1.6, 0.4], Metal);
    world.block([9.0, 9.8], [1.6, 0.8], Wood);
    world.block([12.6, 11.8], [0.9, 0.5], Metal);
    world.block([18.6, 9.4], [2.0, 1.2], Wood);
}

fn route() -> Vec<Vector2<f64>> {
    [
        // South room, out to the corridor, east.
        [11.6, 2.4],
        [13.3, 3.4],
        [13.5, 5.0],
        [14.1, 6.0],
        [17.0, 5.9],
        [21.5, 6.1],
        [23.3, 6.2],
        [24.2, 7.4],
        // East room.
        [25.4, 7.5],
        [27.2, 8.0],
        [27.3, 11.6],
        [26.6, 12.5],
        [24.8, 12.5],
        [23.8, 13.0],
        // West along the north corridor, into a room and out again.
        [22.6, 13.8],
        [20.0, 13.5],
        [18.2, 13.7],
        [17.5, 14.6],
        [17.4, 16.2],
        [16.2, 17.1],
        [12.8, 17.2],
        [11.5, 16.2],
        [11.5, 14.7],
        [10.6, 13.9],
        // West corridor, and back through the second door.
        [7.6, 14.1],
        [6.2, 13.6],
        [6.1, 11.0],
        [6.0, 7.6],
        [6.6, 6.2],
        [8.4, 6.1],
        [9.5, 5.4],
        [9.5, 3.8],
        [10.0, 2.6],
    ]
    .map(Vector2::from)
    .to_vec()
}
