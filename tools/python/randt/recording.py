"""A recording as arrays: sweeps of the radar, samples of the IMU, velocities, the truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Iterator, Union

import numpy as np
import numpy.typing as npt

from randt import _randt

Floats = npt.NDArray[np.float64]
PathText = Union[str, Path]


class Scan:
    """One sweep of the radar: beams in order of time, returns by beam."""

    def __init__(
        self,
        azimuth_rad: npt.ArrayLike,
        beam_stamp_ns: npt.ArrayLike,
        range_m: npt.ArrayLike,
        intensity: npt.ArrayLike,
        beam: npt.ArrayLike,
        range_resolution_m: float,
        azimuth_step_rad: float = 0.0,
        span_ns: tuple[int, int] | None = None,
    ) -> None:
        """Of B beams (azimuth in the radar's frame, counter-clockwise; stamps rising) and N returns
        (range, intensity, index of the beam; sorted by beam, then range). `azimuth_step_rad` is the
        angle between two beams; 0 where it is not known. `span_ns` is when the sweep begins and
        ends; if not given, its first and last beam. ValueError where arrays do not fit."""
        self._scan = _randt.Scan(
            np.asarray(azimuth_rad, "<f4").tobytes(),
            np.asarray(beam_stamp_ns, "<i8").tobytes(),
            np.asarray(range_m, "<f4").tobytes(),
            np.asarray(intensity, "<f4").tobytes(),
            np.asarray(beam, "<u2").tobytes(),
            range_resolution_m,
            azimuth_step_rad,
            span_ns,
        )

    @classmethod
    def _wrapped(cls, scan: _randt.Scan) -> Scan:
        wrapped = cls.__new__(cls)
        wrapped._scan = scan
        return wrapped

    @property
    def stamp_ns(self) -> int:
        """The sweep's end."""
        return self._scan.stamp_ns

    @property
    def span_ns(self) -> tuple[int, int]:
        """When the sweep begins and ends."""
        return self._scan.span_ns

    @property
    def range_resolution_m(self) -> float:
        """Width of a range bin, m."""
        return self._scan.range_resolution_m

    @property
    def azimuth_step_rad(self) -> float:
        """Angle between two beams, rad; 0 where it is not known."""
        return self._scan.azimuth_step_rad

    @property
    def azimuth_rad(self) -> npt.NDArray[np.float32]:
        """Azimuth of every beam, rad, (B,)."""
        return np.frombuffer(self._scan.azimuth_rad(), "<f4")

    @property
    def beam_stamp_ns(self) -> npt.NDArray[np.int64]:
        """When every beam was measured, (B,)."""
        return np.frombuffer(self._scan.beam_stamp_ns(), "<i8")

    @property
    def range_m(self) -> npt.NDArray[np.float32]:
        """Range of every return, m, (N,)."""
        return np.frombuffer(self._scan.range_m(), "<f4")

    @property
    def intensity(self) -> npt.NDArray[np.float32]:
        """Intensity of every return, in the sensor's unit, (N,)."""
        return np.frombuffer(self._scan.intensity(), "<f4")

    @property
    def beam(self) -> npt.NDArray[np.uint16]:
        """Index of every return's beam, (N,)."""
        return np.frombuffer(self._scan.beam(), "<u2")

    def points(self) -> npt.NDArray[np.float32]:
        """x m, y m in the radar's frame and intensity of every return, as they were seen, (N, 3)."""
        azimuth = self.azimuth_rad[self.beam]
        xy = (np.cos(azimuth) * self.range_m, np.sin(azimuth) * self.range_m)
        return np.stack([*xy, self.intensity], axis=1)


@dataclass(frozen=True)
class Imu:
    """A sample of the IMU, in its own frame."""

    stamp_ns: int
    rate_rad_s: Floats
    """Angular rate about x, y, z, rad/s, (3,)."""
    acceleration_m_s2: Floats
    """Specific force along x, y, z, m/s^2, (3,)."""


@dataclass(frozen=True)
class Twist:
    """A velocity of the robot in `base_link`."""

    stamp_ns: int
    velocity: Floats
    """Forward m/s, left m/s, yaw rate rad/s, (3,)."""
    covariance: Floats
    """Of these, (3, 3); a variance of 0 is unknown."""


@dataclass(frozen=True)
class Truth:
    """Where the robot truly was; in simulated recordings only."""

    stamp_ns: int
    pose: Floats
    """x m, y m, yaw rad, (3,)."""


Event = Union[Scan, Imu, Twist, Truth]


class Recording:
    """A recording, event by event in its order; iterate over it once."""

    def __init__(self, recording: _randt.Recording) -> None:
        self._recording = recording

    @property
    def format(self) -> str:
        """What kind of file it is, such as `ros1-bag`."""
        return self._recording.format

    @property
    def sensor(self) -> str | None:
        """The radar, where the file has it."""
        return self._recording.sensor

    @property
    def radar_mounting(self) -> Floats | None:
        """x m, y m, yaw rad of the radar in `base_link`, where the file has it."""
        mounting = self._recording.radar_mounting
        return None if mounting is None else np.array(mounting)

    @property
    def imu_mounting_rad(self) -> Floats | None:
        """Roll, pitch, yaw of the IMU in `base_link`, where the file has it."""
        mounting = self._recording.imu_mounting_rad
        return None if mounting is None else np.array(mounting)

    def counters(self) -> dict[str, int]:
        """What was dropped, repaired or assumed so far, and how often."""
        return {name: count for name, count, _, _ in self._recording.counters() if count}

    def __iter__(self) -> Iterator[Event]:
        while (event := self._recording.next_event()) is not None:
            kind, values = event
            if kind == "scan":
                yield Scan._wrapped(values)
            elif kind == "imu":
                yield Imu(values[0], np.array(values[1]), np.array(values[2]))
            elif kind == "twist":
                yield Twist(values[0], np.array(values[1]), np.array(values[2]).reshape(3, 3))
            else:
                yield Truth(values[0], np.array(values[1]))


def read(
    path: PathText,
    radar_topic: str | None = None,
    imu_topic: str | None = None,
    twist_topic: str | None = None,
) -> Recording:
    """Opens anything that `randt run` reads. ValueError where it cannot be read."""
    return Recording(_randt.Recording(path, radar_topic, imu_topic, twist_topic))
