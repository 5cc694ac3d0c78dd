"""Reads the bus of a running randt: numpy and PyPI's iceoryx2 0.10 are all it needs.

Printed by `randt layout --python`; print it anew for another build. A type's name has a hash of
its layout, so a stage of another build is refused instead of being misread.

    for message in Bus().subscribe("odometry/state/v1"):
        print(message.head["pose"])
"""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator

import iceoryx2 as iox2
import numpy as np


@dataclass(frozen=True)
class Topic:
    """A topic's messages: the type's name on the bus, the head, and what follows it."""

    type_name: str
    head: np.dtype
    item: Any


@dataclass(frozen=True)
class Message:
    """A message, copied out of shared memory: a numpy record and an array of items."""

    head: np.void
    items: np.ndarray


class Subscription:
    """One topic, message by message, in order. It holds no stage up: what is not read in time is
    dropped, and shows as a gap in `head["header"]["sequence"]`."""

    def __init__(self, node: Any, name: str, topic: Topic) -> None:
        self._topic = topic
        self._head = type(
            "Head",
            (ctypes.Structure,),
            {
                # As aligned as the stages' heads are.
                "_fields_": [("words", ctypes.c_uint64 * (topic.head.itemsize // 8))],
                "type_name": staticmethod(lambda: topic.type_name),
            },
        )
        service_name = iox2.ServiceName.new(name)
        messages = node.service_builder(service_name).publish_subscribe(iox2.Slice[ctypes.c_uint8])
        try:
            # The listener first: no message that comes to the port may go unnoticed.
            notices = node.service_builder(service_name).event().open()
            self._listener = notices.listener_builder().create()
            service = messages.user_header(self._head).open()
            self._port = service.subscriber_builder().create()
        except Exception as cause:
            raise RuntimeError(f"{name}: {cause}: {_advice(str(cause))}") from cause
        # Writers deliver their history at once to a reader that says it has come.
        joined = node.service_builder(iox2.ServiceName.new("stage/joined")).event().open()
        joined.notifier_builder().create().notify()

    def receive(self) -> Message | None:
        """The next message, or None where there is none yet."""
        sample = self._port.receive()
        if sample is None:
            return None
        head = ctypes.string_at(sample.user_header_ptr, self._topic.head.itemsize)
        payload = sample.payload()
        items = ctypes.string_at(payload.as_ptr(), payload.len())
        record = np.frombuffer(head, self._topic.head)[0]
        return Message(record, np.frombuffer(items, self._topic.item or "u1"))

    def wait(self, timeout_s: float) -> None:
        """Sleeps until a message comes, or this long."""
        self._listener.timed_wait(iox2.Duration.from_millis(int(timeout_s * 1e3)))

    def __iter__(self) -> Iterator[Message]:
        while True:
            message = self.receive()
            if message is None:
                self.wait(0.5)
            else:
                yield message


def _advice(cause: str) -> str:
    """What to do about an error of iceoryx2."""
    if "Incompatible" in cause:
        return "its stage is of another build: print this module anew"
    if "ExceedsMax" in cause:
        return "all places are taken; `randt doctor --clean` frees those of dead readers"
    if "DoesNotExist" in cause:
        return "no stage has opened it; `randt top` shows what runs"
    return "`randt doctor` may say more"


class Bus:
    """The stages of one pipeline, found as the programs find them: by prefix and run folder."""

    def __init__(self, prefix: str = "randt", run: str | Path | None = None) -> None:
        run = os.path.abspath(run if run is not None else default_run())
        # FNV-1a, 64 bit: the same prefix in another run folder is another pipeline.
        number = 0xCBF29CE484222325
        for byte in os.fsencode(run):
            number = (number ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
        config = iox2.config.default()
        config.global_cfg.root_path = iox2.Path.new(f"{run}/{prefix}/bus")
        config.global_cfg.prefix = iox2.FileName.new(f"{prefix}-{number & 0xFFFF:04x}_")
        # What dead processes have left is the stages' to clear away.
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        iox2.set_log_level(iox2.LogLevel.Fatal)
        builder = iox2.NodeBuilder.new().config(config)
        builder = builder.signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self._node = builder.create(iox2.ServiceType.Ipc)

    def subscribe(self, name: str) -> Subscription:
        """Opens a topic. RuntimeError where no stage has opened it, or one of another build."""
        return Subscription(self._node, name, TOPICS[name])


def default_run() -> Path:
    """The run folder of programs that are not given one."""
    system, user = Path("/run/randt"), os.geteuid()
    if system.is_dir():
        return system
    for session in (os.environ.get("XDG_RUNTIME_DIR"), f"/run/user/{user}"):
        if session and Path(session).is_absolute() and Path(session).is_dir():
            found = os.lstat(session)
            if found.st_uid == user and found.st_mode & 0o777 == 0o700:
                return Path(session) / "randt"
    return Path(f"/dev/shm/randt-{user}")
