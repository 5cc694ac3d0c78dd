from os import PathLike
from typing import Any

Triple = tuple[float, float, float] | list[float]

class Scan:
    def __init__(
        self,
        azimuth_rad: bytes,
        beam_stamp_ns: bytes,
        range_m: bytes,
        intensity: bytes,
        beam: bytes,
        range_resolution_m: float,
        azimuth_step_rad: float,
        span_ns: tuple[int, int] | None,
    ) -> None: ...
    stamp_ns: int
    span_ns: tuple[int, int]
    range_resolution_m: float
    azimuth_step_rad: float
    def azimuth_rad(self) -> bytes: ...
    def beam_stamp_ns(self) -> bytes: ...
    def range_m(self) -> bytes: ...
    def intensity(self) -> bytes: ...
    def beam(self) -> bytes: ...

class State:
    stamp_ns: int
    odom_frame_id: int
    pose: list[float]
    velocity: list[float]
    covariance: list[float]
    trust: str
    localizability: str
    weak_direction_rad: float | None
    gyro_bias_rad_s: list[float]
    fit: float
    cells: int
    inliers: int

class Keyframe:
    stamp_ns: int
    odom_frame_id: int
    pose: list[float]
    def points(self) -> bytes: ...

class Recording:
    def __init__(
        self,
        path: str | PathLike[str],
        radar_topic: str | None = ...,
        imu_topic: str | None = ...,
        twist_topic: str | None = ...,
    ) -> None: ...
    format: str
    sensor: str | None
    radar_mounting: list[float] | None
    imu_mounting_rad: list[float] | None
    def counters(self) -> list[tuple[str, int, str, bool]]: ...
    def next_event(self) -> tuple[str, Any] | None: ...

class Estimator:
    def __init__(
        self,
        profile: str | None = ...,
        sensor: str | None = ...,
        robot: str | None = ...,
        set: list[str] = ...,
        use_imu: bool = ...,
        radar_mounting: Triple | None = ...,
        imu_mounting_rad: Triple | None = ...,
    ) -> None: ...
    def push_scan(self, scan: Scan) -> list[State]: ...
    def push_imu(
        self, stamp_ns: int, rate_rad_s: Triple, acceleration_m_s2: Triple
    ) -> list[State]: ...
    def push_twist(self, stamp_ns: int, velocity: Triple, covariance: list[float]) -> list[State]: ...
    def finish(self) -> list[State]: ...
    def keyframes(self) -> list[Keyframe]: ...

def register(
    first: Scan,
    second: Scan,
    profile: str | None = ...,
    sensor: str | None = ...,
    robot: str | None = ...,
    set: list[str] = ...,
) -> tuple[list[float], State]: ...
def evaluate(estimate: str, truth: str) -> list[tuple[str, float | None]]: ...
def main(arguments: list[str]) -> int: ...
def bus_module() -> str: ...
