//! Where values come from, and what is refused.

mod bounds;

use super::*;

fn profile(name: &str) -> Loaded {
    Config::load(&Selection {
        profile: Some(name.to_owned()),
        ..Selection::default()
    })
    .unwrap()
}

fn refusal(set: &str) -> String {
    let selection = Selection {
        set: vec![set.to_owned()],
        ..Selection::default()
    };
    Config::load(&selection).unwrap_err().to_string()
}

#[test]
fn mixed_is_the_default_and_holds_the_defaults() {
    let loaded = Config::load(&Selection::default()).unwrap();
    assert_eq!(loaded, profile("mixed"));
    assert_eq!(loaded.config, Config::default());
}

#[test]
fn profiles_hold_the_papers_values() {
    let cell_size_m = |name| profile(name).config.ndt.cell_size_m;
    assert_eq!(
        ["indoor", "outdoor", "mixed", "oxford"].map(cell_size_m),
        [0.5, 1.2, 1.0, 3.5]
    );
    let loss_alpha = |name| profile(name).config.odometry.loss_alpha;
    assert_eq!(
        ["indoor", "outdoor", "mixed", "oxford"].map(loss_alpha),
        [-2.0, -1.0, -1.5, -2.0]
    );
}

#[test]
fn every_default_is_in_its_own_range() {
    let config = Config::default();
    for section in Config::SECTIONS {
        for key in section.keys {
            let text = format!(
                "{}.{}={}",
                section.name,
                key.name,
                config.get(section.name, key.name).unwrap()
            );
            let mut again = Loaded::default();
            apply_override(&text, &mut again).unwrap();
            assert_eq!(again.config, config, "{text}");
            assert!(key.doc.iter().all(|line| !line.is_empty()), "{text}");
        }
    }
}

#[test]
fn what_lies_in_the_folder_beside_a_robots_file_goes_over_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.toml");
    std::fs::write(&path, "[robot]\nradar_x_m = 0.1\nradar_y_m = 0.2\n").unwrap();
    let drop_ins = folder.path().join("robot.toml.d");
    std::fs::create_dir(&drop_ins).unwrap();
    for (name, text) in [
        ("20-mine.toml", "[robot]\nradar_x_m = 0.3\n"),
        (
            "10-fleet.toml",
            "[robot]\nradar_x_m = 0.4\nradar_yaw_rad = 0.5\n",
        ),
        ("README.md", "no configuration"),
    ] {
        std::fs::write(drop_ins.join(name), text).unwrap();
    }
    let selection = Selection {
        robot: Some(path.display().to_string()),
        ..Selection::default()
    };
    let robot = Config::load(&selection).unwrap().config.robot;
    assert_eq!(
        (robot.radar_x_m, robot.radar_y_m, robot.radar_yaw_rad),
        (0.3, 0.2, 0.5)
    );
    std::fs::write(drop_ins.join("30-wrong.toml"), "[robot]\nradar_q_m = 1\n").unwrap();
    let refusal = Config::load(&selection).unwrap_err().to_string();
    assert!(
        refusal.contains("robot.toml.d/30-wrong.toml:2"),
        "{refusal}"
    );
}

#[test]
fn the_sensor_follows_the_driver_where_there_is_no_input() {
    let selection = |set: &str| Selection {
        set: vec![set.to_owned()],
        ..Selection::default()
    };
    let sensor = |selection| Config::load(&selection).unwrap().config.sensor.name;
    assert_eq!(sensor(selection("radar.source=navtech")), "navtech-cts");
    assert_eq!(sensor(selection("radar.source=beam-udp")), "isdr-c");
    let log = Selection {
        sensor_from_input: Some("isdr-c"),
        ..selection("radar.source=navtech")
    };
    assert_eq!(sensor(log), "isdr-c");
    assert!(refusal("radar.source=navteck").contains("\"navtech\" or \"beam-udp\""));
}

#[test]
fn an_address_makes_no_other_map() {
    let fingerprint = |set: &str| {
        let selection = Selection {
            set: vec![set.to_owned()],
            ..Selection::default()
        };
        Config::load(&selection).unwrap().config.fingerprint()
    };
    let here = fingerprint("radar.address=10.0.0.1:6317");
    assert_eq!(here, Config::default().fingerprint());
    assert_ne!(here, fingerprint("sensor.keep_power=1"));
}

#[test]
fn the_sensor_follows_the_input_unless_the_user_says_otherwise() {
    let selection = Selection {
        sensor_from_input: Some("navtech-cts"),
        ..Selection::default()
    };
    let sensor = |selection: &Selection| Config::load(selection).unwrap().config.sensor;
    assert_eq!(sensor(&selection).name, "navtech-cts");
    assert_eq!(sensor(&selection).range_resolution_m, 0.0438);
    let selection = Selection {
        sensor: Some("isdr-c".to_owned()),
        ..selection
    };
    assert_eq!(sensor(&selection).name, "isdr-c");
    let selection = Selection {
        set: vec!["sensor.period_s = 0.1".into(), "sensor.name=mine".into()],
        ..selection
    };
    assert_eq!(sensor(&selection).period_s, 0.1);
    assert_eq!(sensor(&selection).name, "mine");
}

#[test]
fn overrides_are_checked_and_the_last_one_counts() {
    let set = |set: &[&str]| {
        Config::load(&Selection {
            set: set.iter().map(|&s| s.to_owned()).collect(),
            ..Selection::default()
        })
        .unwrap()
        .config
    };
    assert_eq!(set(&["odometry.window=5"]).odometry.window, 5);
    assert_eq!(set(&["ndt.cell_size_m=2"]).ndt.cell_size_m, 2.0);
    assert_eq!(
        set(&["ndt.cell_size_m=2", "ndt.cell_size_m=3"])
            .ndt
            .cell_size_m,
        3.0
    );
    assert!(!set(&["odometry.deskew=false"]).odometry.deskew);
    assert_eq!(
        set(&["odometry.graduation=[2, 1]"]).odometry.graduation,
        [2.0, 1.0]
    );
}

#[test]
fn a_refusal_names_key_value_and_what_is_right() {
    for (set, words) in [
        (
            "ndt.cell_size_m=0",
            "ndt.cell_size_m is 0, it must be from 0.05 to 100",
        ),
        (
            "ndt.cell_size_m=nan",
            "ndt.cell_size_m is nan, it must be from",
        ),
        (
            "filter.range_max_m=inf",
            "filter.range_max_m is inf, it must be from 0.5 to 1000 (nearer is",
        ),
        ("filter.range_max_m=1e999", "it must be"),
        (
            "odometry.window=0",
            "odometry.window is 0, it must be from 1 to 20",
        ),
        (
            "odometry.window=-1",
            "odometry.window is -1, it must be a whole number",
        ),
        (
            "odometry.window=2.5",
            "odometry.window is 2.5, it must be a whole number",
        ),
        (
            "odometry.loss_alpha=2",
            "a multiple of 0.5, from -16 to 1.5",
        ),
        ("odometry.loss_alpha=0.7", "a multiple of 0.5"),
        (
            "odometry.graduation=[1.0, 1.2]",
            "falling, and 1.0 at the end",
        ),
        ("odometry.graduation=[]", "falling, and 1.0 at the end"),
        ("odometry.deskew=1", "true or false"),
        ("robot.radar_x_m=inf", "from -100 to 100"),
        (
            "robot.radar_x_m=left",
            "robot.radar_x_m is left, it must be a number",
        ),
        (
            "ndt.cellsize=1",
            "unknown key \"ndt.cellsize\"; did you mean \"ndt.cell_size_m\"?",
        ),
        ("ndt.range_max_m=1", "did you mean \"filter.range_max_m\"?"),
        (
            "odometri.window=1",
            "unknown section [odometri]; did you mean [odometry]?",
        ),
        ("window=1", "section.key=value"),
        ("odometry.window", "section.key=value"),
        ("odometry.graduation=[1e9, 1.0]", "none above 1000"),
        (
            "ndt.cell_size_m=0.05",
            "ndt.cell_size_m = 0.05 (--set) together make a submap of the map of this many squares to a side: 800, at most 512 are possible",
        ),
        (
            "submap.overlap_m=50",
            "submap.overlap_m = 50.0 (--set), it must be below submap.radius_m = 15.0 (default)",
        ),
    ] {
        let text = refusal(set);
        assert!(text.contains(words), "{set}: {text}");
    }
}

#[test]
fn an_unknown_name_shows_the_nearest() {
    let selection = Selection {
        profile: Some("indor".to_owned()),
        ..Selection::default()
    };
    let text = Config::load(&selection).unwrap_err().to_string();
    assert!(text.contains("did you mean \"indoor\"?"), "{text}");
}

#[test]
fn a_file_is_refused_with_its_lines_and_all_that_is_wrong() {
    let problems = |text: &str, only| -> Vec<String> {
        let layer = Layer {
            source: "my.toml",
            text,
            only,
        };
        layer
            .apply(&mut Loaded::default())
            .iter()
            .map(Error::to_string)
            .collect()
    };
    let found = problems(
        "cell_size_m = 1.0\n[ndt]\npoints = 3\ncell_size_m = -1.0\n\n[odom]\nwindow = 3\n",
        None,
    );
    let expected = [
        "my.toml:1: unknown key \"cell_size_m\"; did you mean \"ndt.cell_size_m\"?",
        "my.toml:3: unknown key \"ndt.points\"; did you mean \"ndt.points_min\"?",
        "my.toml:4: ndt.cell_size_m is -1.0, it must be from 0.05 to 100 (three range bins; a street's width)",
        "my.toml:6: unknown section [odom]; did you mean [odometry]?",
    ];
    assert_eq!(found, expected);
    let found = problems("[sensor]\nname = \"x\"\n[ndt]\n", Some(SENSOR_FILE));
    assert!(found[0].starts_with("my.toml:3: section [ndt] does not belong"));
    assert!(problems("[ndt\n", None)[0].starts_with("my.toml:1: "));
    assert!(problems("[[ndt]]\n", None)[0].contains("write [ndt]"));
    assert!(problems("ndt = 3\n", None)[0].contains("write [ndt]"));
}

#[test]
fn what_is_shown_can_be_read_back() {
    for selection in [
        Selection::default(),
        Selection {
            profile: Some("oxford".to_owned()),
            sensor_from_input: Some("navtech-cts"),
            set: vec![
                "robot.imu_roll_rad=3.1".into(),
                "sensor.name=\"a \\\" \\n b\"".into(),
            ],
            ..Selection::default()
        },
    ] {
        let loaded = Config::load(&selection).unwrap();
        let text = loaded.to_toml();
        let layer = Layer {
            source: "shown",
            text: &text,
            only: None,
        };
        let mut again = Loaded::default();
        let problems = layer.apply(&mut again);
        assert!(problems.is_empty(), "{problems:?}\n{text}");
        assert_eq!(again.config, loaded.config, "{text}");
        assert_eq!(again.is_set("robot"), loaded.is_set("robot"));
    }
}

#[test]
fn a_logs_own_configuration_may_have_keys_of_another_build() {
    let text = "[odometry]\ndegenerate_ratio = 0.01\nwindow = 4\n[old]\nkey = 1\n";
    let selection = |text: &str| Selection {
        recorded: Some(text.to_owned()),
        ..Selection::default()
    };
    let loaded = Config::load(&selection(text)).unwrap();
    assert_eq!(loaded.config.odometry.window, 4);
    assert_eq!(loaded.passed_over.len(), 2, "{:?}", loaded.passed_over);
    assert!(loaded.passed_over[0].contains("\"odometry.degenerate_ratio\""));
    // A value that does not run is refused all the same.
    assert!(Config::load(&selection("[odometry]\nwindow = 99\n")).is_err());
}

#[test]
fn a_zero_has_no_sign() {
    let set = |text: &str| {
        let selection = Selection {
            set: vec![text.to_owned()],
            ..Selection::default()
        };
        Config::load(&selection).unwrap().config
    };
    let minus = set("robot.radar_x_m=-0.0");
    assert!(minus.robot.radar_x_m.is_sign_positive());
    assert_eq!(
        minus.fingerprint(),
        set("robot.radar_x_m=0.0").fingerprint()
    );
}
