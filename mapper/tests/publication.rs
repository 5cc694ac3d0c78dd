//! What the mapper publishes is what it knows: pages of the graph, the correction, tiles as the
//! map's picture has them.

use randt_config::Config;
use randt_geometry::Pose2;
use randt_mapper::Mapper;
use randt_mapper::publication::{correction, fill_graph, fill_tile, list_tiles};
use randt_messages::{
    GRAPH_ENTRIES_MAX, GraphEntry, Keyframe, KeyframeBeam, KeyframePoint, MapperGraph, MapperGrid,
    Message, TILE_CELLS,
};

/// A keyframe every half metre along x that sees a wall two metres to its left.
fn keyframe(id: u64, odom_frame_id: u64) -> Message<Keyframe> {
    let mut keyframe = Message::<Keyframe>::default();
    let head = &mut *keyframe.head;
    (head.id, head.odom_frame_id) = (id, odom_frame_id);
    head.header.stamp_ns = 1_000_000_000 * id as i64;
    head.pose = [0.5 * id as f64, 0.3, 0.0];
    head.beam_count = 40;
    for n in 0..40_u32 {
        let (x_m, y_m) = (0.1 * n as f32 - 2.0, 2.0);
        head.beams[n as usize] = KeyframeBeam {
            x_m: 0.0,
            y_m: 0.0,
            azimuth_rad: randt_geometry::elementary::atan2(f64::from(y_m), f64::from(x_m)) as f32,
            first_point: n,
        };
        keyframe.items.push(KeyframePoint {
            x_m,
            y_m,
            intensity: 9.0,
            beam: n as u16,
            reserved: 0,
        });
    }
    keyframe
}

fn mapper(ids: std::ops::Range<u64>, new_frame_at: u64) -> Mapper {
    let mut mapper = Mapper::new(&Config::default());
    for id in ids {
        assert!(mapper.push(keyframe(id, 3 + u64::from(id >= new_frame_at)).as_ref()));
    }
    mapper
}

#[test]
fn the_graph_comes_in_pages() {
    let mapper = mapper(10..1510, 1000);
    let mut message = Message::<MapperGraph>::default();
    message.head.on_disk = 77;
    let mut entries: Vec<GraphEntry> = Vec::new();
    let mut next = Some(0);
    while let Some(first) = next {
        next = fill_graph(&mapper, first, &mut message);
        assert_eq!(message.head.first_entry as usize, entries.len());
        assert!(message.items.len() <= GRAPH_ENTRIES_MAX);
        entries.extend_from_slice(&message.items);
    }
    assert_eq!(entries.len(), 1500);
    let head = &message.head;
    assert_eq!((head.keyframes, head.wanted_keyframe), (1500, 1510));
    assert_eq!((head.components, head.loops, head.odom_frame_id), (2, 0, 4));
    assert_eq!((head.graph_version, head.on_disk), (1500, 77));
    assert_eq!(head.header.stamp_ns, 1509 * 1_000_000_000);
    assert!((head.path_m - 0.5 * 1498.0).abs() < 1e-9);
    let last = entries.last().unwrap();
    assert_eq!((last.a, last.b, last.kind), (1509, 1000, 0));
    assert_eq!(last.pose, mapper.poses()[1499].to_array());
    let mut empty = Message::default();
    assert_eq!(
        fill_graph(&Mapper::new(&Config::default()), 0, &mut empty),
        None
    );
    assert_eq!((empty.head.wanted_keyframe, empty.items.len()), (0, 0));
    // A page behind the last one is empty.
    assert_eq!(fill_graph(&mapper, 9999, &mut empty), None);
    assert!(empty.items.is_empty());
}

#[test]
fn the_correction_puts_the_newest_keyframe_where_the_map_has_it() {
    assert_eq!(correction(&Mapper::new(&Config::default())), None);
    let mapper = mapper(0..30, 20);
    let correction = correction(&mapper).unwrap();
    assert_eq!((correction.odom_frame_id, correction.component), (4, 4));
    assert_eq!(correction.graph_version, 30);
    let odom = mapper.keyframes()[29].odom_from_base;
    let map = Pose2::from_array(correction.map_from_odom).compose(&odom);
    assert!((map.translation() - mapper.poses()[29].translation()).norm() < 1e-12);
}

#[test]
fn a_grid_painted_bit_by_bit_is_the_same() {
    let cells = |mapper: &Mapper| -> Vec<_> {
        let tiles = mapper.grid().tiles();
        tiles
            .map(|(index, tile)| (index, tile.cells().collect::<Vec<_>>()))
            .collect()
    };
    let (mut whole, mut slices) = (mapper(0..40, 1000), mapper(0..40, 1000));
    assert_eq!(whole.update_grid().added, 40);
    let slice = |mapper: &mut Mapper| {
        let update = mapper.update_grid_by(15);
        (update.added, update.left)
    };
    let slices_of_three = [(); 4].map(|()| slice(&mut slices));
    assert_eq!(slices_of_three, [(15, 25), (15, 10), (10, 0), (0, 0)]);
    assert!(!cells(&whole).is_empty() && cells(&whole) == cells(&slices));
}

#[test]
fn tiles_say_what_the_picture_says_and_only_new_ones_come() {
    let mut mapper = mapper(0..40, 99);
    mapper.update_grid();
    let mut tiles = Vec::new();
    let version = list_tiles(&mapper, 0, &mut tiles);
    assert_eq!(tiles.len(), mapper.grid().tiles().count());
    let picture = mapper.grid().picture().unwrap();
    let mut message = Message::<MapperGrid>::default();
    let mut known = 0;
    for index in &tiles {
        fill_tile(&mapper, *index, &mut message);
        assert_eq!(message.items.len(), TILE_CELLS * TILE_CELLS);
        assert_eq!((message.head.column, message.head.row), (index.x, index.y));
        for (n, cell) in message.items.iter().enumerate() {
            // The middle of the cell, as a planner would ask for it.
            let at = |tile: i32, cell: usize| {
                (f64::from(tile) * TILE_CELLS as f64 + cell as f64 + 0.5)
                    * message.head.resolution_m
            };
            let [x, y] = [at(index.x, n % TILE_CELLS), at(index.y, n / TILE_CELLS)];
            let [column, row] = [x - picture.origin_m[0], y - picture.origin_m[1]]
                .map(|m| (m / picture.resolution_m).floor());
            let inside = column >= 0.0
                && row >= 0.0
                && column < picture.width as f64
                && row < picture.height as f64;
            let pixel = inside.then(|| {
                picture.pixels
                    [(picture.height - 1 - row as usize) * picture.width + column as usize]
            });
            let expected = match pixel {
                Some(0) => 100,
                Some(254) => 0,
                _ => 255,
            };
            assert_eq!(*cell, expected, "{index:?} {n}");
            known += usize::from(*cell != 255);
        }
    }
    assert!(known > 300, "{known}");

    assert_eq!(list_tiles(&mapper, version, &mut tiles), version);
    assert!(tiles.is_empty());
    mapper.push(keyframe(40, 3).as_ref());
    mapper.update_grid();
    assert!(list_tiles(&mapper, version, &mut tiles) > version);
    assert!(!tiles.is_empty() && tiles.len() < mapper.grid().tiles().count());
}
