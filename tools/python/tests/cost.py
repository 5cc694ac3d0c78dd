"""What a sweep costs in Python and in Rust, by turns over the same drive: cost.py DRIVE [ROUNDS]

From arrays, as a radar of one's own has them, to the state. Rust's figure has every IMU sample since
the last sweep in it; so has the first of Python's, while the second has only the sample that
completes the state. Run it with a package that was built in release."""

import sys
import tempfile
import time

import numpy as np

import randt


def python_ms(drive):
    """Sweeps with all samples since the last one, and with those alone that complete a state."""
    recording = randt.read(drive)
    estimator = randt.Odometry(
        profile="indoor",
        sensor=recording.sensor,
        radar_mounting=recording.radar_mounting,
        imu_mounting_rad=recording.imu_mounting_rad,
    )
    with_all_s, with_one_s = [], []
    for event in recording:
        is_scan = isinstance(event, randt.Scan)
        if is_scan:
            with_all_s.append(0.0)
            with_one_s.append(0.0)
            arrays = (
                event.azimuth_rad,
                event.beam_stamp_ns,
                event.range_m,
                event.intensity,
                event.beam,
                event.range_resolution_m,
                event.azimuth_step_rad,
                event.span_ns,
            )
        begin = time.perf_counter()
        states = estimator.push(randt.Scan(*arrays) if is_scan else event)
        took_s = time.perf_counter() - begin
        if with_all_s and not isinstance(event, randt.Truth):
            with_all_s[-1] += took_s
            with_one_s[-1] += took_s if is_scan or states else 0.0
    both_ms = np.array([with_all_s, with_one_s]) * 1e3
    return np.median(both_ms, axis=1), np.percentile(both_ms, 99, axis=1), len(with_all_s)


def rust_ms(drive):
    """Its own figures of the same code."""
    with tempfile.TemporaryDirectory() as folder:
        timing = randt.run(drive, folder, profile="indoor").report["timing"]
    both = timing["filter_and_odometry"]
    return both["median_ms"], both["p99_ms"]


drive = sys.argv[1]
rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 10
rust, python = [], []
for number in range(rounds):
    rust.append(rust_ms(drive))
    *figures, count = python_ms(drive)
    python.append(figures)
rust, python = np.array(rust), np.array(python)
print(f"{count} sweeps, {rounds} rounds of each by turns; medians of the rounds, ms")
for row, figure in enumerate(["median", "p99"]):
    print(f"{figure}: Rust {np.median(rust[:, row]):.3f}")
    for column, samples in enumerate(["all samples", "the one that completes"]):
        taken = python[:, row, column]
        more = taken - rust[:, row]
        print(
            f"{figure}, {samples}: Python {np.median(taken):.3f}, more by {np.median(more):.3f} "
            f"(rounds {more.min():.3f} to {more.max():.3f})"
        )
