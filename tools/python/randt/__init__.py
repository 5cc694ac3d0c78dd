"""Radar SLAM for robots that work where cameras and LiDAR are blind.

    import randt

    result = randt.run("drive.bag", out="results")       # the whole: trajectory, map, report
    print(result.trajectory.pose[-1], result.map.cells.shape)

    estimator = randt.Odometry(profile="indoor")          # step by step
    for event in randt.read("drive.bag"):
        for state in estimator.push(event):
            print(state.pose, state.trust)

Poses are x m, y m, yaw rad; x forward, y left, counter-clockwise. Stamps are ns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from randt.odometry import Keyframe, Odometry, State, register
from randt.recording import Imu, Recording, Scan, Truth, Twist, read
from randt.results import Map, Run, Trajectory, evaluate, run

if TYPE_CHECKING:
    from randt.bus import Bus

__all__ = [
    "Bus",
    "Imu",
    "Keyframe",
    "Map",
    "Odometry",
    "Recording",
    "Run",
    "Scan",
    "State",
    "Trajectory",
    "Truth",
    "Twist",
    "evaluate",
    "read",
    "register",
    "run",
]


def __getattr__(name: str) -> Any:
    # The bus needs PyPI's iceoryx2, and nothing else here does.
    if name == "Bus":
        from randt.bus import Bus

        return Bus
    raise AttributeError(f"module 'randt' has no attribute '{name}'")
