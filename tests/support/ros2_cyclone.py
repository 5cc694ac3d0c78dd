"""Nodes of ROS 2 as far as DDS sees them, by Cyclone DDS: an implementation that knows nothing of
ours. Types are those of ROS 2 Jazzy, as rosbags has them.

ros2_cyclone.py play BAG [--speed S] [--best-effort]   publishes a ROS 2 bag, and waits for acknowledgement
ros2_cyclone.py echo [--namespace NAME]                prints each message of ours as a line of JSON
ros2_cyclone.py offers                                 prints whose the topics are, and their quality
ros2_cyclone.py call SERVICE                           calls a std_srvs/Trigger, prints its response
ros2_cyclone.py frames BAG FILE                        writes a bag's messages, for other programs
"""

import argparse
import json
import struct
import sys
import time
from pathlib import Path

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

JAZZY = get_typestore(Stores.ROS2_JAZZY)
# A char of ROS is no character.
PLAIN = {"string": str, "bool": bool, "char": types.uint8}
# Seconds until others have to have been found.
FOUND_MAX = 20
# What rviz2 and nav2 ask for: whether reliable, whether what was said before, and how much is kept,
# which is more here: Python on a busy machine is slower than a node.
SENSOR_DATA, USUAL, LATCHED = (False, False, 1000), (True, False, 1000), (True, True, 1)
OURS = {
    "/randt/odometry": ("nav_msgs/msg/Odometry", USUAL),
    "/tf": ("tf2_msgs/msg/TFMessage", USUAL),
    "/tf_static": ("tf2_msgs/msg/TFMessage", LATCHED),
    "/randt/map": ("nav_msgs/msg/OccupancyGrid", LATCHED),
    "/randt/path": ("nav_msgs/msg/Path", LATCHED),
    "/randt/keyframes": ("geometry_msgs/msg/PoseArray", LATCHED),
    "/randt/radar/points": ("sensor_msgs/msg/PointCloud2", SENSOR_DATA),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", USUAL),
}
known = {}


def idl(name):
    """A type of ROS as one of DDS."""
    if name not in known:
        package, own = name.split("/msg/")
        fields = {field: of(kind) for field, kind in JAZZY.fielddefs[name][1]}
        known[name] = make_idl_struct(own, f"{package}::msg::dds_::{own}_", fields)
    return known[name]


def of(kind):
    """A field's type."""
    sort, what = kind
    if sort.name == "BASE":
        base = what[0]
        return PLAIN.get(base) or getattr(types, base)
    if sort.name == "NAME":
        return idl(what)
    inner, size = what
    return types.array[of(inner), size] if sort.name == "ARRAY" else types.sequence[of(inner)]


def quality(reliable, kept, depth):
    """What a node asks for, or offers."""
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def show(**what):
    print(json.dumps(what), flush=True)


def topic(participant, name, type_name):
    return Topic(participant, f"rt{name}", idl(type_name))


def messages(bag):
    """Topic, type, time and bytes of each message of a bag, static transforms first."""
    with AnyReader([Path(bag)]) as reader:
        all_messages = [(c.topic, c.msgtype, at, raw) for c, at, raw in reader.messages()]
    all_messages.sort(key=lambda it: (it[0] != "/tf_static", it[2]))
    return all_messages


def play(arguments):
    bag = messages(arguments.bag)
    participant, writers = DomainParticipant(), {}
    for name, type_name, _, _ in bag:
        if name not in writers:
            offered = LATCHED if name == "/tf_static" else (not arguments.best_effort, False, 100)
            writers[name] = DataWriter(participant, topic(participant, name, type_name), qos=quality(*offered))
    begin = time.monotonic()
    while not all(writer.get_matched_subscriptions() for writer in writers.values()):
        if time.monotonic() > begin + FOUND_MAX:
            sys.exit("nobody subscribes")
        time.sleep(0.01)
    # A subscriber that has asked for the least may ask for more, now that all are known.
    time.sleep(0.5)
    begin, first = time.monotonic(), bag[0][2]
    first = min(at for _, _, at, _ in bag)
    sent = 0
    for name, type_name, at, raw in bag:
        wait = begin + (at - first) / 1e9 / arguments.speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        writers[name].write(idl(type_name).deserialize(bytes(raw)))
        sent += 1
    acknowledged = all(writer.wait_for_acks(duration(seconds=10)) for writer in writers.values())
    show(sent=sent, acknowledged=acknowledged)


def echo(arguments):
    participant, readers = DomainParticipant(), {}
    for name, (type_name, asked) in OURS.items():
        name = arguments.namespace + name
        readers[name] = DataReader(participant, topic(participant, name, type_name), qos=quality(*asked))
    show(ready=True)
    while True:
        for name, reader in readers.items():
            for message in reader.take(N=100):
                if not message.sample_info.valid_data:
                    continue
                show(topic=name, **summary(message))
        time.sleep(0.002)


def stamp_ns(header):
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def summary(message):
    """What a test needs of a message."""
    if hasattr(message, "transforms"):
        frames = [[t.header.frame_id, t.child_frame_id] for t in message.transforms]
        return {"stamp_ns": stamp_ns(message.transforms[0].header), "frames": frames}
    found = {"stamp_ns": stamp_ns(message.header), "frame": message.header.frame_id}
    if hasattr(message, "twist"):
        position = message.pose.pose.position
        found |= {"x": position.x, "y": position.y, "child": message.child_frame_id}
        found["variance"] = message.pose.covariance[0]
    if hasattr(message, "info"):
        found |= {"width": message.info.width, "cells": len(message.data)}
    if hasattr(message, "poses"):
        found["poses"] = len(message.poses)
    if hasattr(message, "point_step"):
        found |= {"width": message.width, "bytes": len(message.data)}
    return found


def offers(_):
    participant = DomainParticipant()
    publications = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    graph = Topic(participant, "ros_discovery_info", idl("rmw_dds_common/msg/ParticipantEntitiesInfo"))
    graph = DataReader(participant, graph, qos=quality(*LATCHED))
    while True:
        for found in publications.take(N=100):
            if found.sample_info.valid_data and not found.topic_name.startswith("DCPS"):
                show(
                    topic=found.topic_name,
                    type=found.type_name,
                    reliable=Policy.Reliability.BestEffort not in found.qos,
                    kept=Policy.Durability.TransientLocal in found.qos,
                    gid=found.key.bytes.hex(),
                )
        for found in graph.take(N=10):
            if found.sample_info.valid_data:
                for node in found.node_entities_info_seq:
                    writers = [bytes(it.data)[:16].hex() for it in node.writer_gid_seq]
                    show(node=node.node_namespace + node.node_name, writers=writers)
        time.sleep(0.01)


def call(arguments):
    # As rmw_cyclonedds_cpp does it: the client and the request's number before the message.
    head = {"client": types.uint64, "number": types.int64}
    request_type = make_idl_struct("Request", "std_srvs::srv::dds_::Trigger_Request_", head | {"nothing": types.uint8})
    fields = head | {"success": bool, "message": str}
    response_type = make_idl_struct("Response", "std_srvs::srv::dds_::Trigger_Response_", fields)
    participant = DomainParticipant()
    requests = Topic(participant, f"rq{arguments.service}Request", request_type)
    requests = DataWriter(participant, requests, qos=quality(*USUAL))
    replies = Topic(participant, f"rr{arguments.service}Reply", response_type)
    replies = DataReader(participant, replies, qos=quality(*USUAL))
    begin, is_asked = time.monotonic(), False
    while time.monotonic() < begin + FOUND_MAX:
        is_found = requests.get_matched_subscriptions() and replies.get_matched_publications()
        if is_found and not is_asked:
            requests.write(request_type(client=0x1122334455667788, number=7, nothing=0))
            is_asked = True
        for reply in replies.take():
            if reply.client == 0x1122334455667788 and reply.number == 7:
                return show(success=reply.success, message=reply.message)
        time.sleep(0.01)
    sys.exit("no reply")


def frames(arguments):
    with open(arguments.file, "wb") as out:
        for name, type_name, at, raw in messages(arguments.bag):
            package, own = type_name.split("/msg/")
            for text in (f"rt{name}".encode(), f"{package}::msg::dds_::{own}_".encode()):
                out.write(struct.pack("<I", len(text)) + text)
            out.write(struct.pack("<qI", at, len(raw)) + bytes(raw))


def main():
    parser = argparse.ArgumentParser()
    actions = parser.add_subparsers(required=True)
    for action in (play, echo, offers, call, frames):
        actions.add_parser(action.__name__).set_defaults(run=action)
    of_play, of_echo, _, of_call, of_frames = actions.choices.values()
    of_play.add_argument("bag")
    of_play.add_argument("--speed", type=float, default=1.0)
    of_play.add_argument("--best-effort", action="store_true")
    of_echo.add_argument("--namespace", default="")
    of_call.add_argument("service")
    of_frames.add_argument("bag")
    of_frames.add_argument("file")
    arguments = parser.parse_args()
    arguments.run(arguments)


main()
