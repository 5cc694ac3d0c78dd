"""What a sweep costs in Python, beside Rust's own figure for the same drive: cost.py DRIVE"""

import sys
import tempfile
import time

import numpy as np

import randt

drive = sys.argv[1]
with tempfile.TemporaryDirectory() as folder:
    timing = randt.run(drive, folder, profile="indoor").report["timing"]
recording = randt.read(drive)
estimator = randt.Odometry(
    profile="indoor",
    sensor=recording.sensor,
    radar_mounting=recording.radar_mounting,
    imu_mounting_rad=recording.imu_mounting_rad,
)
# A sweep is filtered where it is pushed, and estimated where the sample comes that covers it.
pushed_s, estimated_s = [], []
for event in recording:
    if isinstance(event, randt.Scan):
        # Arrays, as a radar of one's own has them.
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
        event = randt.Scan(*arrays)
    else:
        begin = time.perf_counter()
    states = estimator.push(event)
    took_s = time.perf_counter() - begin
    if isinstance(event, randt.Scan):
        pushed_s.append(took_s)
    elif states:
        estimated_s.append(took_s)
count = min(len(pushed_s), len(estimated_s))
python_ms = np.median(np.add(pushed_s[:count], estimated_s[:count])) * 1e3
rust_ms = timing["filter_and_odometry"]["median_ms"]
print(f"a sweep, median: Python {python_ms:.3f} ms, Rust {rust_ms:.3f} ms")
