"""Whole runs and their files as arrays."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Sequence

import numpy as np
import numpy.typing as npt

from randt import _randt
from randt.recording import Floats, PathText


@dataclass(frozen=True)
class Trajectory:
    """Poses with their stamps, of a TUM file."""

    stamp_ns: npt.NDArray[np.int64]
    """(N,)."""
    pose: Floats
    """x m, y m, yaw rad, (N, 3)."""

    @classmethod
    def read(cls, path: PathText) -> Trajectory:
        """Reads a TUM file: a pose a line, lines with # are comments."""
        stamps, poses = [], []
        for line in Path(path).read_text().splitlines():
            if line.startswith("#") or not line.strip():
                continue
            stamp, x, y, _, qx, qy, qz, qw = line.split()
            seconds, _, fraction = stamp.partition(".")
            stamps.append(int(seconds) * 1_000_000_000 + int(fraction.ljust(9, "0")[:9]))
            z, w = float(qz), float(qw)
            poses.append((float(x), float(y), math.atan2(2.0 * z * w, w * w - z * z)))
        return cls(np.array(stamps, np.int64), np.array(poses, float).reshape(-1, 3))


@dataclass(frozen=True)
class Map:
    """The occupancy grid as Nav2's map_server reads it."""

    cells: npt.NDArray[np.uint8]
    """Grey values (rows, columns), the first row at the top: 0 occupied, 254 free, 205 unknown."""
    resolution_m: float
    origin: Floats
    """x m, y m, yaw rad of the lower left corner, (3,)."""

    @classmethod
    def read(cls, folder: PathText) -> Map:
        """Reads map.pgm and map.yaml of a folder."""
        values = dict(
            line.split(": ", 1)
            for line in (Path(folder) / "map.yaml").read_text().splitlines()
            if ": " in line
        )
        origin = [float(value) for value in values["origin"].strip("[]").split(",")]
        pgm = (Path(folder) / "map.pgm").read_bytes()
        header: list[bytes] = []
        size = 0
        # P5, columns, rows, 255; lines with # are comments.
        while len(header) < 4:
            end = pgm.index(b"\n", size)
            line = pgm[size:end]
            header += [] if line.startswith(b"#") else line.split()
            size = end + 1
        columns, rows = int(header[1]), int(header[2])
        cells = np.frombuffer(pgm, "u1", columns * rows, size).reshape(rows, columns)
        return cls(cells, float(values["resolution"]), np.array(origin))


@dataclass(frozen=True)
class Run:
    """What `run` has computed, and where its files are."""

    folder: Path
    exit_code: int
    """0, or 3 where data were lost: `report` says which."""
    trajectory: Trajectory
    """The final pose of every scan, in the map."""
    odometry: Trajectory
    """The live pose of every scan, in `odom`."""
    map: Map
    report: dict[str, Any]
    """report.json: loops, counters, timing, the configuration in force."""


def run(
    path: PathText,
    out: PathText,
    profile: str | None = None,
    sensor: str | None = None,
    robot: PathText | None = None,
    set: Sequence[str] = (),
    options: Sequence[str] = (),
    quiet: bool = True,
) -> Run:
    """Computes trajectory and map of a recording, as `randt run` does, and reads them.

    `options` are further ones of `randt run`, such as `--no-imu`. RuntimeError with the program's
    words where it fails.
    """
    line = [sys.executable, "-m", "randt", "run", str(path), "--out", str(out), *options]
    for name, value in (("--profile", profile), ("--sensor", sensor), ("--robot", robot)):
        line += [] if value is None else [name, str(value)]
    for key in set:
        line += ["--set", key]
    ended = subprocess.run(line, stdout=subprocess.PIPE if quiet else None, stderr=subprocess.PIPE)
    if ended.returncode not in (0, 3):
        raise RuntimeError(ended.stderr.decode(errors="replace").strip())
    folder = Path(out)
    return Run(
        folder,
        ended.returncode,
        Trajectory.read(folder / "trajectory.tum"),
        Trajectory.read(folder / "odometry.tum"),
        Map.read(folder),
        json.loads((folder / "report.json").read_text()),
    )


def evaluate(estimate: PathText, truth: PathText) -> dict[str, float | None]:
    """How far a trajectory is off the truth, both as TUM files: `ate_rmse_m` and the other figures
    of `randt-lab eval`; None where one is not defined. ValueError where the two have nothing in
    common."""
    return dict(_randt.evaluate(str(estimate), str(truth)))
