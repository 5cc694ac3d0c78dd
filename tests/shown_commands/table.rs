//! Every command that a document shows in a block, and who runs it.

use super::Runner::{self, File, Here, Nobody};

const PAGE_ROBOT: &str = "docs/tutorial-robot.md";
const PAGE_PROGRAMMER: &str = "docs/tutorial-programmer.md";
const EMULATED: &str = "tests/support/robot.rs";

/// `FILE` and `LOG` are a drive of 40 sweeps here, `robot.toml` sensors that nobody emulates.
pub const COMMANDS: &[(&str, Runner)] = &[
    // README.md, CONTRIBUTING.md, introduction.md
    ("cargo run -- demo", File(".ci/run", "-- demo")),
    (
        "cargo test --workspace",
        File(".ci/run", "cargo test --workspace"),
    ),
    (
        "cargo test --test programs mission::",
        Nobody("a part of the whole test"),
    ),
    (
        "cargo clippy --workspace --all-targets -- -D warnings",
        File(".ci/run", "--workspace --all-targets -- -D warnings"),
    ),
    (
        "mdbook build docs",
        Nobody("mdBook is no part of CI; .ci/vocabulary checks the links, a test the pages"),
    ),
    (
        "cargo bench",
        Nobody("takes minutes; clippy compiles what it runs"),
    ),
    (".ci/vocabulary", File(".ci/run", ".ci/vocabulary")),
    (".ci/run", Nobody("is what runs the tests")),
    (
        "cargo build --workspace",
        File(".ci/run", "cargo test --locked --workspace --no-run"),
    ),
    (
        "export RANDT=$PWD PATH=$PWD/target/debug:$PATH",
        File("tests/tutorials.rs", "env(\"RANDT\""),
    ),
    (
        "randt run INPUT --out DIR [--profile indoor|outdoor|mixed|oxford|FILE] [--sensor isdr-c|navtech-cts|FILE] [--set key=value] [--no-imu] [--no-loops]",
        Here(
            "randt run FILE --out run --profile indoor --sensor isdr-c --set loops.verify=true --no-imu --no-loops",
        ),
    ),
    (
        "randt up --robot robot.toml --out DIR",
        File(PAGE_ROBOT, "randt up --robot robot.toml --out live"),
    ),
    (
        "randt doctor sensors --robot robot.toml",
        File(PAGE_ROBOT, "randt doctor sensors --robot robot.toml"),
    ),
    (
        "randt up ... --record logs --view",
        File("tests/drive_end.rs", "\"--view\", \"--record\""),
    ),
    (
        "randt up --play LOG --out DIR",
        File(PAGE_PROGRAMMER, "randt up --play drive.mcap --out live"),
    ),
    ("randt top", File("tests/top.rs", "\"top\"")),
    ("randt doctor", File(PAGE_ROBOT, "randt doctor\n")),
    // bus.md
    ("randt layout", Here("randt layout")),
    ("randt layout --python", Here("randt layout --python")),
    ("randt layout --c", Here("randt layout --c")),
    ("randt layout --rust", Here("randt layout --rust")),
    (
        "randt layout --python > randt_bus.py",
        File(PAGE_PROGRAMMER, "randt layout --python > randt_bus.py"),
    ),
    (
        "pip install numpy iceoryx2==0.10.0",
        File(PAGE_PROGRAMMER, "numpy iceoryx2==0.10.0"),
    ),
    (
        "randt layout --c > randt_bus.h",
        File(PAGE_PROGRAMMER, "randt layout --c > randt_bus.h"),
    ),
    (
        "cc -std=c11 follow_pose.c -L target/debug -Wl,-rpath,target/debug -lrandt_bus -lm -o follow_pose",
        File(
            PAGE_PROGRAMMER,
            "cc -std=c11 follow_pose.c -L $RANDT/target/debug -Wl,-rpath,$RANDT/target/debug -lrandt_bus",
        ),
    ),
    ("./follow_pose", File(PAGE_PROGRAMMER, "./follow_pose 10")),
    // commands.md
    (
        "docker build -t randt .",
        Nobody("images of others cannot be fetched here"),
    ),
    (
        "docker run --rm -v \"$PWD:/data\" randt run DRIVE.bag --out results",
        Nobody("images of others cannot be fetched here"),
    ),
    (
        "docker run --rm --network host --shm-size 256m -v \"$PWD:/data\" randt up --robot robot.toml --out live",
        Nobody("images of others cannot be fetched here"),
    ),
    // calibrate.md
    (
        "randt calibrate time LOG.mcap",
        File("tests/calibrate.rs", "\"time\""),
    ),
    (
        "randt calibrate extrinsics LOG.mcap --write robot.toml",
        File("tests/calibrate.rs", "\"--write\""),
    ),
    // drivers.md
    (
        "randt simulate building --out drive.mcap --scans 600",
        Here("randt simulate building --out drive.mcap --scans 10"),
    ),
    (
        "randt emulate radar --proto beam-udp --log drive.mcap --address 127.0.0.1:6320 --loop &",
        File(EMULATED, "emulate"),
    ),
    (
        "randt emulate imu --proto mip --log drive.mcap --link /tmp/imu --loop --fault silence@20+3 &",
        File("tests/resources.rs", "--fault"),
    ),
    (
        "randt up --out live --set radar.address=127.0.0.1:6320 --set imu.source=mip --set imu.device=/tmp/imu --set robot.radar_x_m=0.12",
        File("tests/ports.rs", "imu.source=mip"),
    ),
    // log.md
    (
        "randt record --out logs",
        File("tests/documents.rs", "\"record\""),
    ),
    (
        "randt log info FILE",
        Here("randt log info FILE && randt log info FILE --json"),
    ),
    (
        "randt log check FILE ...",
        Here("randt log check FILE FILE && randt log check FILE --json"),
    ),
    (
        "randt log recover FILE.active",
        File("tests/log.rs", "\"recover\""),
    ),
    (
        "randt log cut FILE --from 60 --to 90 --out PART.mcap",
        Here("randt log cut FILE --from 1 --to 3 --out PART.mcap"),
    ),
    (
        "randt log export FILE --to csv | tum | ros1 | ros2 | foxglove",
        Here(
            "for to in csv tum ros1 ros2 foxglove; do randt log export FILE --to $to || exit; done",
        ),
    ),
    (
        "randt log export FILE --foxglove",
        Here("rm FILE.foxglove.mcap && randt log export FILE --foxglove"),
    ),
    (
        "randt plot FILE --out DIR",
        Here("randt plot FILE --out pictures"),
    ),
    (
        "randt run FILE --out DIR",
        Here("randt run FILE --out again"),
    ),
    // pipeline.md
    (
        "randt-mapper --journal map.journal &",
        File("tests/support/pipeline.rs", "--journal"),
    ),
    (
        "randt-odometry &",
        File("tests/support/pipeline.rs", "\"odometry\""),
    ),
    (
        "randt-filter &",
        File("tests/support/pipeline.rs", "\"filter\""),
    ),
    ("randt play LOG", File("tests/pipeline.rs", "\"play\"")),
    // python.md
    (
        "pip install .",
        Nobody("a build in release of its own; tools/python/tests runs the same files"),
    ),
    ("cargo build --release", Nobody("a build in release")),
    (
        "pip wheel --no-deps --wheel-dir wheels .",
        Nobody("a build in release of its own"),
    ),
    (
        "python tools/python/add_programs.py wheels/randt-*.whl target/release",
        File("tools/python/tests/wheel.py", "\"add_programs.py\""),
    ),
    (
        "pip install wheels/randt-*.whl",
        File("tools/python/tests/wheel.py", "\"install\""),
    ),
    (
        "cp -r tools/python/randt randt && ln -s ../target/debug/deps/lib_randt.so randt/_randt.abi3.so",
        File("tools/python/tests/package.rs", "_randt.abi3.so"),
    ),
    // link.md
    (
        "randt-link keys keys base",
        Here("randt-link keys keys base"),
    ),
    (
        "randt-link keys keys spot",
        Here("randt-link keys keys spot"),
    ),
    (
        "randt-link --robot /etc/randt/robot.toml --journal link.journal",
        File("tests/link/ends.rs", "\"--journal\""),
    ),
    (
        "randt-link --robot /etc/randt/link-spot.toml --prefix spot",
        File("tests/link/ends.rs", "\"--robot\""),
    ),
    (
        "randt top --prefix spot",
        Nobody("shows a base's bus until somebody ends it; tests/top.rs"),
    ),
    // ros.md
    (
        "cargo build --release -p randt-ros2",
        Nobody("a build in release"),
    ),
    (
        "randt-ros2 --radar-topic /radar/points --imu-topic /imu/data",
        File("tests/support/ros2_nodes.rs", "\"--radar-topic\""),
    ),
    (
        "apt install python3-rospy python3-roslaunch python3-sensor-msgs python3-nav-msgs python3-tf2-msgs python3-diagnostic-msgs",
        File(".ci/run", "python3-rospy python3-rosbag"),
    ),
    (
        "cargo build --release -p randt-ros1",
        Nobody("a build in release"),
    ),
    (
        "randt up --no-drivers --robot robot.toml --out DIR &",
        Nobody("waits for ROS's sweeps; tests/ros1.rs starts the same stages one by one"),
    ),
    (
        "randt-ros1 --radar-topic /radar/points --imu-topic /imu/data",
        File("tests/ros1.rs", "\"--radar-topic\""),
    ),
    // trust-bench.md
    (
        "randt-lab bench trust --against docs/trust-bench.csv",
        Nobody("the whole bench takes hours"),
    ),
    (
        "randt-lab bench trust --worlds corridor,MY/WORLDS --faults none,rain --seeds 1 --scans 800",
        Here(
            "randt-lab bench trust --worlds corridor --faults none,rain --seeds 1 --scans 20 --out trust.csv || [ $? = 3 ]",
        ),
    ),
    (
        "randt-lab bench trust --quick",
        File("tests/trust_bench.rs", "\"--quick\""),
    ),
    // view.md
    ("randt-view", File("tests/view.rs", "\"view\"")),
    (
        "ssh -C -L 8765:localhost:8765 robot",
        Nobody("needs another machine"),
    ),
    // worlds.md
    (
        "randt simulate --world FILE --out LOG.mcap --truth TRUTH.tum",
        Here(
            "printf 'post concrete 3,0 0.3\\npost concrete 0,4 0.3\\npost metal -5,-1 0.3\\nspeed 0.5\\nroute 0,0 1,0 1,1 0,1\\n' > own.world && randt simulate --world own.world --scans 20 --out LOG.mcap --truth TRUTH.tum",
        ),
    ),
    (
        "randt run LOG.mcap --out OUT",
        Here("randt run LOG.mcap --out OUT"),
    ),
    (
        "randt-lab eval OUT/odometry.tum TRUTH.tum --trust OUT/report.json",
        Here("randt-lab eval OUT/odometry.tum TRUTH.tum --trust OUT/report.json"),
    ),
    // tests/fuzz, core/log/tests/fixtures
    (
        "RUSTC_BOOTSTRAP=1 cargo fuzz run --fuzz-dir tests/fuzz bag",
        Nobody("needs cargo-fuzz, and never ends"),
    ),
    (
        "randt simulate --world empty.world --scans 40 --out drive.mcap",
        Nobody("made a kept log with programs of its day"),
    ),
    (
        "randt up --play drive.mcap --out OUT --record LOGS --set record.zstd_level=19",
        Nobody("made a kept log with programs of its day"),
    ),
    (
        "randt log cut LOGS/*.mcap --from 7.5 --to 7.9 --out layouts-1.mcap",
        Nobody("made a kept log with programs of its day"),
    ),
];
