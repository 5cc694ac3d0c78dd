"""Filter and odometry step by step, and the registration of two scans."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence

import numpy as np
import numpy.typing as npt

from randt import _randt
from randt.recording import Event, Floats, Imu, PathText, Scan, Twist


@dataclass(frozen=True)
class State:
    """The estimate at the end of a sweep."""

    stamp_ns: int
    odom_frame_id: int
    """Poses of two frames are not comparable."""
    pose: Floats
    """x m, y m, yaw rad of `base_link` in `odom`, (3,)."""
    velocity: Floats
    """Forward m/s, left m/s, yaw rate rad/s, (3,)."""
    covariance: Floats
    """Of x, y, yaw against the submap, in the frame of `base_link`, (3, 3)."""
    trust: str
    """good, degraded or lost."""
    localizability: str
    """Which directions the scan sees: full, partial, none, unknown."""
    weak_direction_rad: float | None
    """The direction that it does not see, in `base_link`, where that is one."""
    gyro_bias_rad_s: Floats
    fit: float
    """How well the scan fits, 0 to 1."""
    cells: int
    inliers: int

    @classmethod
    def _from(cls, state: _randt.State) -> State:
        return cls(
            state.stamp_ns,
            state.odom_frame_id,
            np.array(state.pose),
            np.array(state.velocity),
            np.array(state.covariance).reshape(3, 3),
            state.trust,
            state.localizability,
            state.weak_direction_rad,
            np.array(state.gyro_bias_rad_s),
            state.fit,
            state.cells,
            state.inliers,
        )


@dataclass(frozen=True)
class Keyframe:
    """A scan with its final pose, the robot's motion removed."""

    stamp_ns: int
    odom_frame_id: int
    pose: Floats
    """x m, y m, yaw rad in `odom`, (3,)."""
    points: npt.NDArray[np.float32]
    """x m, y m in `base_link` and intensity, (N, 3)."""


class Odometry:
    """Filter and odometry, step by step: the code that runs on the robot."""

    def __init__(
        self,
        profile: str | None = None,
        sensor: str | None = None,
        robot: PathText | None = None,
        set: Sequence[str] = (),
        use_imu: bool = True,
        radar_mounting: Sequence[float] | Floats | None = None,
        imu_mounting_rad: Sequence[float] | Floats | None = None,
    ) -> None:
        """`profile`, `sensor`, `robot` and `set` as `randt run` takes them. Mountings as a recording
        has them hold where `robot` sets none. With `use_imu` a scan waits for the samples that
        cover it. ValueError for a wrong configuration."""
        self._estimator = _randt.Estimator(
            profile,
            sensor,
            None if robot is None else str(robot),
            list(set),
            use_imu,
            None if radar_mounting is None else [float(value) for value in radar_mounting],
            None if imu_mounting_rad is None else [float(value) for value in imu_mounting_rad],
        )

    def push(self, event: Event) -> list[State]:
        """Takes an event of a recording; gives the states that it completes."""
        if isinstance(event, Scan):
            return self.push_scan(event)
        if isinstance(event, Imu):
            return self.push_imu(event.stamp_ns, event.rate_rad_s, event.acceleration_m_s2)
        if isinstance(event, Twist):
            return self.push_twist(event.stamp_ns, event.velocity, event.covariance)
        return []

    def push_scan(self, scan: Scan) -> list[State]:
        """Takes a sweep. ValueError where its bins or beams are not the configured radar's."""
        return [State._from(state) for state in self._estimator.push_scan(scan._scan)]

    def push_imu(
        self, stamp_ns: int, rate_rad_s: npt.ArrayLike, acceleration_m_s2: npt.ArrayLike
    ) -> list[State]:
        """Takes a sample of the IMU: rates (3,) rad/s, specific forces (3,) m/s^2."""
        rate, acceleration = np.asarray(rate_rad_s, float), np.asarray(acceleration_m_s2, float)
        states = self._estimator.push_imu(stamp_ns, rate.tolist(), acceleration.tolist())
        return [State._from(state) for state in states]

    def push_twist(
        self, stamp_ns: int, velocity: npt.ArrayLike, covariance: npt.ArrayLike
    ) -> list[State]:
        """Takes a velocity (3,) and its covariance (3, 3)."""
        speed, spread = np.asarray(velocity, float), np.asarray(covariance, float)
        states = self._estimator.push_twist(stamp_ns, speed.tolist(), spread.ravel().tolist())
        return [State._from(state) for state in states]

    def finish(self) -> list[State]:
        """The recording is at its end: gives what is still waited for."""
        return [State._from(state) for state in self._estimator.finish()]

    def keyframes(self) -> list[Keyframe]:
        """The keyframes since the last call."""
        return [
            Keyframe(
                keyframe.stamp_ns,
                keyframe.odom_frame_id,
                np.array(keyframe.pose),
                np.frombuffer(keyframe.points(), "<f4").reshape(-1, 3),
            )
            for keyframe in self._estimator.keyframes()
        ]


def register(
    first: Scan,
    second: Scan,
    profile: str | None = None,
    sensor: str | None = None,
    robot: PathText | None = None,
    set: Sequence[str] = (),
) -> tuple[Floats, State]:
    """The pose (3,) of the second scan's `base_link` in the first one's, and the state with its
    covariance. ValueError where the scans are too far apart in time or too empty."""
    robot_text = None if robot is None else str(robot)
    motion, state = _randt.register(
        first._scan, second._scan, profile, sensor, robot_text, list(set)
    )
    return np.array(motion), State._from(state)
