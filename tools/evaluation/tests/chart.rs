//! Figures over time.

use randt_evaluation::{Band, Chart, Colour, Line, Panel, plot_chart};

fn line(name: &'static str, points: Vec<[f64; 2]>) -> Line {
    Line {
        name,
        colour: Colour::First,
        points,
    }
}

fn chart(panels: &[Panel]) -> String {
    plot_chart(&Chart {
        title: "drive <1>",
        since: "the log's beginning",
        span_s: 60.0,
        panels,
    })
    .unwrap()
}

#[test]
fn the_same_figures_give_the_same_picture_of_bounded_size() {
    let fast = (0..500_000).map(|n| [f64::from(n) * 1.2e-4, f64::from((n % 1001 * 79) % 1001)]);
    let band = |from: f64| Band {
        name: "missing",
        colour: Colour::Bad,
        span_s: [from, from + 0.001],
    };
    let panels = [
        Panel {
            label: "yaw rate, deg/s".to_owned(),
            lines: vec![line("gyro", fast.collect())],
            bands: vec![band(3.0), band(9.0)],
            ..Panel::default()
        },
        Panel {
            label: "latency, ms".to_owned(),
            lines: vec![line(
                "",
                (0..300)
                    .map(|n| [f64::from(n) * 0.2, if n == 99 { 830.0 } else { 2.0 }])
                    .collect(),
            )],
            at_least: Some([0.0, 0.0]),
            cut_outliers: true,
            ..Panel::default()
        },
        Panel {
            label: "speed, m/s".to_owned(),
            is_low: true,
            ..Panel::default()
        },
    ];
    let svg = chart(&panels);
    assert_eq!(svg, chart(&panels));
    for words in [
        "yaw rate, deg/s",
        "gyro",
        "speed, m/s",
        "above the axis: 1, up to 830",
        "no data",
        "&lt;1&gt;",
        "time since",
    ] {
        assert!(svg.contains(words), "{words}");
    }
    assert_eq!(
        svg.matches("missing").count(),
        1,
        "bands of one name are one entry"
    );
    assert!(svg.len() < 200_000, "{} bytes", svg.len());
    if let Some(path) = std::env::var_os("RANDT_CHART") {
        std::fs::write(path, svg).unwrap();
    }
}

#[test]
fn nothing_and_nonsense_can_be_charted() {
    assert!(chart(&[]).contains("</svg>"));
    let nonsense = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        -1e300,
        1e300,
        0.0,
    ];
    let points = nonsense.iter().flat_map(|x| nonsense.map(|y| [*x, y]));
    let panel = Panel {
        lines: vec![line("", points.collect())],
        bands: nonsense
            .map(|time_s| Band {
                name: "band",
                colour: Colour::Warning,
                span_s: [time_s, time_s],
            })
            .to_vec(),
        cut_outliers: true,
        ..Panel::default()
    };
    for span_s in nonsense {
        let panels = [panel.clone()];
        let drawn = plot_chart(&Chart {
            title: "",
            since: "",
            span_s,
            panels: &panels,
        });
        assert!(drawn.unwrap().len() < 100_000);
    }
}
