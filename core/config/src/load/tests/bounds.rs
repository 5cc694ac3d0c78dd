//! Every number has bounds, and a value beyond them is refused.

use super::*;

/// Every key that takes numbers, with the text of its bounds.
fn bounded() -> Vec<(String, [f64; 2], bool)> {
    let mut keys = Vec::new();
    for section in Config::SECTIONS {
        for key in section.keys {
            if let crate::Rule::Within { least, most, .. } = key.rule {
                let name = format!("{}.{}", section.name, key.name);
                let default = Config::default().get(section.name, key.name).unwrap();
                keys.push((name, [least, most], !default.contains('.')));
            }
        }
    }
    keys
}

#[test]
fn every_number_has_bounds_and_one_step_beyond_is_refused_in_words() {
    let set = |name: &str, value: &str| {
        let text = format!("{name}={value}");
        apply_override(&text, &mut Loaded::default()).map_err(|error| error.to_string())
    };
    assert!(bounded().len() > 60, "{}", bounded().len());
    for (name, [least, most], is_whole) in bounded() {
        let beyond = match is_whole {
            true => [(least - 1.0).to_string(), (most + 1.0).to_string()],
            false => [
                format!("{:?}", least.next_down()),
                format!("{:?}", most.next_up()),
            ],
        };
        for value in [least, most] {
            assert_eq!(set(&name, &value.to_string()), Ok(()), "{name}");
        }
        let nonsense = [
            "nan",
            "-nan",
            "inf",
            "-inf",
            "1e999",
            "-1e999",
            "99999999999999999999999",
            "0x10000000000000000",
            "",
            "\"1\"",
            "[1.0]",
            "{}",
            "true",
            "1_",
            "1979-05-27",
            "one",
        ];
        for value in beyond.iter().map(String::as_str).chain(nonsense) {
            let refused = set(&name, value).unwrap_err();
            assert!(
                refused.contains(&name) && refused.contains("must be "),
                "{name}={value}: {refused}"
            );
        }
        // Zeros and the smallest numbers are in range or refused, as any other.
        for value in [0.0, -0.0, f64::MIN_POSITIVE, 5e-324, -5e-324] {
            let taken = set(&name, &format!("{value:?}")).is_ok();
            assert_eq!(
                taken,
                (least..=most).contains(&value) && !is_whole,
                "{name}={value:?}"
            );
        }
    }
    // What has no bounds has no numbers, or rules of its own.
    for section in Config::SECTIONS {
        for key in section
            .keys
            .iter()
            .filter(|key| key.rule == crate::Rule::NoNumber)
        {
            let default = Config::default().get(section.name, key.name).unwrap();
            assert!(
                default.parse::<f64>().is_err() && !default.starts_with('['),
                "{}",
                key.name
            );
        }
    }
}

#[test]
fn bounds_hold_in_files_of_every_kind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.toml").display().to_string();
    for (text, words) in [
        ("[sensor]\nperiod_s = 1e300\n", "sensor.period_s is 1e300"),
        (
            "[robot]\nradar_yaw_rad = 180\n",
            "a turn in radians, not in degrees",
        ),
        (
            "[submap]\nradius_m = 1000\n[ndt]\ncell_size_m = 0.5\n",
            "submap.radius_m = 1000.0",
        ),
        (
            "[loops]\nrings = 200\nsectors = 720\ncandidates = 100\n",
            "a search for loops of rings x sectors^2 x candidates products",
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let refusal = check_file(&path).unwrap_err().to_string();
        assert!(refusal.contains(words), "{refusal}");
        let (sensor, robot) = match text.starts_with("[robot]") {
            true => (None, Some(path.clone())),
            false => (Some(path.clone()), None),
        };
        if text.starts_with("[robot]") || text.starts_with("[sensor]") {
            let selection = Selection {
                sensor,
                robot,
                ..Selection::default()
            };
            let refusal = Config::load(&selection).unwrap_err().to_string();
            assert!(refusal.contains(words), "{refusal}");
        }
    }
}
