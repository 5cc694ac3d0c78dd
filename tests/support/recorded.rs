//! A log as the recorder writes it, without processes: a simulated drive, computed and written as
//! it would be published.

use randt_config::{Config, Selection};
use randt_filter::ClusterFilter;
use randt_log::{CONFIG_METADATA, CONFIG_TOML, LogFile, Options, ROBOT_METADATA};
use randt_mapper::Mapper;
use randt_mapper::publication::{correction, fill_graph, fill_tile, list_tiles};
use randt_messages::{
    DropCause, ImuSampleTopic, Keyframe, LogDropTopic, MapperCorrection, MapperGraph, MapperGrid,
    Message, MessageRef, OdometryState, OdometryStateTopic, RadarPoints, Topic, health::fixed_text,
};
use randt_odometry::{Odometry, Sink};
use randt_simulator::{Event, Robot, Simulation, World};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

const MS: i64 = 1_000_000;

#[derive(Default)]
struct Published {
    states: Vec<OdometryState>,
    keyframes: Vec<Message<Keyframe>>,
}

impl Sink for Published {
    fn state(&mut self, state: &OdometryState) {
        self.states.push(*state);
    }

    fn keyframe(&mut self, keyframe: MessageRef<'_, Keyframe>) {
        self.keyframes.push(Message {
            head: Box::new(*keyframe.head),
            items: keyframe.items.to_vec(),
        });
    }
}

/// That many scans with all that is computed of them. Scans come 20 ms after their sweep's end,
/// samples 1 ms after they were measured, a state 3 ms after its scan; seven samples at the end of
/// the third second are not there.
pub fn write(scans: u64, path: &Path) {
    let hole_ns = 2_972 * MS..3_000 * MS;
    let (begin_ns, mut log) = record(scans, &[path.to_owned()], hole_ns.clone());
    let mut drop = Message::<LogDropTopic>::default().head;
    (drop.begin_ns, drop.end_ns, drop.count) =
        (begin_ns + hole_ns.start, begin_ns + hole_ns.end, 7);
    (drop.header.stamp_ns, drop.cause) = (drop.end_ns, DropCause::Slow as u32);
    drop.topic = fixed_text(ImuSampleTopic::NAME);
    single::<LogDropTopic>(&mut log, *drop);
    log.finish().unwrap();
}

/// That many scans in a mission's logs, one behind the other, and nothing missing.
pub fn write_mission(scans: u64, files: usize, mission: &Path) {
    let logs = mission.join("logs");
    std::fs::create_dir_all(&logs).unwrap();
    let files: Vec<PathBuf> = (0..files)
        .map(|file| logs.join(format!("{file}.mcap")))
        .collect();
    record(scans, &files, 0..0).1.finish().unwrap();
}

fn create(path: &Path, toml: &str) -> LogFile {
    let mut log = LogFile::create(path, Options::default()).unwrap();
    let robot = randt_log::Robot {
        sensor: Robot::default().sensor(),
        radar: Some(Robot::default().radar_mounting.to_array()),
        imu: Some([1.0, 0.0, 0.0, 0.0]),
    };
    log.write_metadata(ROBOT_METADATA, robot.to_metadata())
        .unwrap();
    let toml = BTreeMap::from([(CONFIG_TOML.to_owned(), toml.to_owned())]);
    log.write_metadata(CONFIG_METADATA, toml).unwrap();
    log
}

/// Gives the first stamp and the last of the logs, which is still open.
fn record(scans: u64, files: &[PathBuf], hole_ns: Range<i64>) -> (i64, LogFile) {
    let loaded = Config::load(&Selection::default()).unwrap();
    let (mut config, toml) = (loaded.config.clone(), loaded.to_toml());
    let mounting = Robot::default().radar_mounting;
    (config.robot.radar_x_m, config.robot.radar_y_m) = (mounting.x_m, mounting.y_m);
    let mut files = files.iter();
    let per_file = scans.div_ceil(files.len() as u64);
    let mut log = create(files.next().unwrap(), &toml);
    let mut filter = ClusterFilter::new(&config.filter, &config.sensor);
    let mut odometry = Odometry::new(&config, true);
    let mut mapper = Mapper::new(&config);
    let mut points = Message::<RadarPoints>::default();
    let mut out = Published::default();
    let (mut tiles, mut listed) = (Vec::new(), 0);
    let mut begin_ns = None;
    let mut written = 0;
    for event in Simulation::new(&World::building(), Robot::default(), scans, 7) {
        let now_ns = event.stamp_ns();
        let after_ns = now_ns - *begin_ns.get_or_insert(now_ns);
        match event {
            Event::Scan(mut scan) => {
                if written > 0 && written % per_file == 0 {
                    let next = create(files.next().unwrap(), &toml);
                    std::mem::replace(&mut log, next).finish().unwrap();
                }
                written += 1;
                scan.head.header.published_ns = now_ns + 20 * MS;
                log.write(scan.as_ref()).unwrap();
                filter.process(scan.as_ref(), &mut points);
                points.head.header.published_ns = now_ns + 21 * MS;
                log.write(points.as_ref()).unwrap();
                odometry.push_points(points.as_ref(), &mut out);
            }
            Event::Imu(mut sample) => {
                sample.header.published_ns = now_ns + MS;
                odometry.push_imu(&sample, &mut out);
                if hole_ns.contains(&after_ns) {
                    continue;
                }
                single::<ImuSampleTopic>(&mut log, sample);
            }
            Event::Twist(_) | Event::Truth(_) => {}
        }
        for mut state in out.states.drain(..) {
            state.header.published_ns = state.scan_published_ns + 3 * MS;
            single::<OdometryStateTopic>(&mut log, state);
        }
        for mut keyframe in out.keyframes.drain(..) {
            let published_ns = now_ns + 24 * MS;
            keyframe.head.header.published_ns = published_ns;
            log.write(keyframe.as_ref()).unwrap();
            mapper.push(keyframe.as_ref());
            if keyframe.head.id % 10 == 9 {
                mapper.update_grid();
                listed = list_tiles(&mapper, listed, &mut tiles);
                publish_map(&mapper, &tiles, published_ns, &mut log);
            }
        }
    }
    (begin_ns.unwrap(), log)
}

/// Correction, the whole graph and the tiles that changed.
fn publish_map(
    mapper: &Mapper,
    tiles: &[randt_mapper::occupancy::TileIndex],
    published_ns: i64,
    log: &mut LogFile,
) {
    let mut found = correction(mapper).unwrap();
    found.header.published_ns = published_ns;
    single::<MapperCorrection>(log, found);
    let mut page = Message::<MapperGraph>::default();
    let mut entry = Some(0);
    while let Some(first) = entry {
        entry = fill_graph(mapper, first, &mut page);
        page.head.header.published_ns = published_ns;
        log.write(page.as_ref()).unwrap();
    }
    let mut tile = Message::<MapperGrid>::default();
    for index in tiles {
        fill_tile(mapper, *index, &mut tile);
        tile.head.header.published_ns = published_ns;
        log.write(tile.as_ref()).unwrap();
    }
}

fn single<T: Topic>(log: &mut LogFile, head: T::Head) {
    log.write(MessageRef::<T> {
        head: &head,
        items: &[],
    })
    .unwrap();
}
