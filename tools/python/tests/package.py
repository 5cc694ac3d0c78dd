"""Tests of the Python package; run in an empty folder with the package on PYTHONPATH."""

import contextlib
import io
import re
import subprocess
import sys
import unittest
from pathlib import Path

import numpy as np

import randt

DRIVE = "drive.mcap"
SCANS = 60


def setUpModule():
    line = [sys.executable, "-m", "randt", "simulate", "building"]
    subprocess.run([*line, "--scans", str(SCANS), "--out", DRIVE], check=True)


class Package(unittest.TestCase):
    def test_step_by_step_gives_the_bits_of_a_run(self):
        result = randt.run(DRIVE, "results", profile="indoor")
        recording = randt.read(DRIVE)
        estimator = randt.Odometry(
            profile="indoor",
            sensor=recording.sensor,
            radar_mounting=recording.radar_mounting,
            imu_mounting_rad=recording.imu_mounting_rad,
        )
        states = []
        for event in recording:
            if isinstance(event, randt.Scan):
                # Through arrays and back.
                event = randt.Scan(
                    event.azimuth_rad,
                    event.beam_stamp_ns,
                    event.range_m,
                    event.intensity,
                    event.beam,
                    event.range_resolution_m,
                    event.azimuth_step_rad,
                    event.span_ns,
                )
            states += estimator.push(event)
        states += estimator.finish()
        self.assertEqual(len(states), SCANS)
        self.assertEqual(result.exit_code, 0)
        rows = Path("results/odometry.csv").read_text().splitlines()[1:]
        for state, row in zip(states, rows, strict=True):
            stamp, frame, x, y, yaw, trust = row.split(",")[:6]
            self.assertEqual((state.stamp_ns, state.trust), (int(stamp), trust))
            # The file has every bit.
            self.assertEqual(list(state.pose), [float(x), float(y), float(yaw)])
        self.assertEqual(state.covariance.shape, (3, 3))
        keyframes = estimator.keyframes()
        self.assertGreater(len(keyframes), 5)
        self.assertEqual(keyframes[0].points.shape[1], 3)

        self.assertEqual(result.trajectory.pose.shape, (SCANS, 3))
        self.assertGreater((result.map.cells == 0).sum(), 50)
        self.assertEqual(result.report["counters"], {})

    def test_a_recording_as_arrays(self):
        events = list(randt.read(DRIVE))
        scans = [event for event in events if isinstance(event, randt.Scan)]
        samples = [event for event in events if isinstance(event, randt.Imu)]
        truth = [event for event in events if isinstance(event, randt.Truth)]
        self.assertEqual(len(scans), SCANS)
        self.assertGreater(len(samples), 40 * SCANS)
        self.assertEqual(samples[0].acceleration_m_s2.shape, (3,))
        points = scans[0].points()
        self.assertEqual(points.shape, (len(scans[0].range_m), 3))
        np.testing.assert_allclose(
            np.hypot(points[:, 0], points[:, 1]), scans[0].range_m, rtol=1e-5
        )

        motion, state = randt.register(scans[40], scans[41])
        stamps = [pose.stamp_ns for pose in truth]
        ends = [scan.stamp_ns for scan in scans[40:42]]
        steps = [np.diff(np.interp(ends, stamps, [p.pose[i] for p in truth]))[0] for i in (0, 1)]
        driven_m = np.linalg.norm(steps)
        self.assertAlmostEqual(np.linalg.norm(motion[:2]), driven_m, delta=0.03)
        self.assertEqual(state.trust, "good")

    def test_what_is_wrong_is_named(self):
        with self.assertRaisesRegex(ValueError, "nowhere.bag"):
            randt.read("nowhere.bag")
        with self.assertRaisesRegex(ValueError, "ndt.cell_sise_m"):
            randt.Odometry(set=["ndt.cell_sise_m=1"])
        with self.assertRaisesRegex(ValueError, "3 to 1024 beams"):
            randt.Scan([0.0], [0], [1.0], [1.0], [0], 0.05)
        with self.assertRaisesRegex(ValueError, "sorted by beam"):
            randt.Scan(np.arange(4), np.arange(4), [1.0, 1.0], [1.0, 1.0], [2, 1], 0.05)
        with self.assertRaisesRegex(RuntimeError, "nowhere.bag"):
            randt.run("nowhere.bag", "nothing")

    def test_what_the_documents_show_runs(self):
        page = Path(__file__).parents[3] / "docs/python.md"
        blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.S | re.M)
        self.assertEqual(len(blocks), 1)
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(blocks[0].replace("drive.bag", DRIVE), {})
        self.assertGreater(printed.getvalue().count("good"), SCANS // 2)

    def test_the_program_names_its_version(self):
        line = [sys.executable, "-m", "randt", "--version"]
        printed = subprocess.run(line, check=True, capture_output=True, text=True).stdout
        self.assertRegex(printed, r"^randt \d+\.\d+\.\d+ \(")

    def test_evaluation_and_the_bus_module(self):
        randt.run(DRIVE, "again", options=["--no-loops"])
        figures = randt.evaluate("again/odometry.tum", "again/odometry.tum")
        self.assertLess(figures["ate_rmse_m"], 1e-9)
        try:
            import iceoryx2  # noqa: F401
        except ImportError:
            self.assertRaises(ImportError, getattr, randt, "Bus")
        else:
            self.assertIn("odometry/state/v1", sys.modules[randt.Bus.__module__].TOPICS)


if __name__ == "__main__":
    unittest.main()
