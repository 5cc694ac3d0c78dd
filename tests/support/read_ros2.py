"""Reads logs and ROS bags by libraries that know nothing of ours: mcap-ros2-support and rosbags.

read_ros2.py LOG|BAG... [--tables FOLDER] [--dump FILE]

Every message of every topic has to decode, and what rosbags serialises again has to be the same
bytes. Types of ROS have to be those of ROS 2 Humble or ROS 1 Noetic. What is said once has to be
there for who subscribes late. With tables, as `randt log export --to csv
--items` writes them, each number of the one log has to be the one there. A dump is for readers in
other languages: one line a topic, its definition and messages as JSON.
"""

import argparse
import base64
import csv
import json
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

ARRAY_MAX = 16
# Of large messages that many a topic are decoded: it is slow, and all are alike.
LARGE, LARGE_MOST = 20_000, 5
HUMBLE, NOETIC = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
LATCHED = ["/tf_static", "/map", "/path"]


def plain(value):
    """A decoded value as numbers, lists and dictionaries; constants are none of them."""
    if hasattr(type(value), "__slots__") and not isinstance(value, (int, float, str, bytes)):
        return {name: plain(getattr(value, name)) for name in type(value).__slots__}
    if isinstance(value, (list, tuple)):
        return [plain(element) for element in value]
    return value


def columns(value, name=""):
    """The numbers of a message, by the names that the tables have."""
    if isinstance(value, dict):
        for key, inside in value.items():
            outer = "" if name == "header" else name
            yield from columns(inside, f"{outer}.{key}" if outer else key)
    elif isinstance(value, (bytes, bytearray)):
        yield name, bytes(value).split(b"\0")[0].decode()
    elif isinstance(value, list):
        if value and isinstance(value[0], (int, float)) and len(value) <= ARRAY_MAX:
            for index, element in enumerate(value):
                yield f"{name}.{index}", element
    else:
        yield name, value


def is_same(text, value, codes):
    """Whether a cell of a table shows a number: with all its digits, or by its code's name."""
    if isinstance(value, str):
        return text == value
    if text in codes.get(value, ()):
        return True
    if isinstance(value, int):
        return text == str(value)
    # Single precision is written with the digits that it needs.
    return float(text) == value or abs(float(text) - value) <= 6e-8 * abs(value)


def read(path, tables):
    found = Counter()
    rows, items = {}, {}
    with open(path, "rb") as file:
        factory = DecoderFactory()
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            found[channel.topic] += 1
            assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg"), channel.topic
            if len(message.data) > LARGE and found[channel.topic] > LARGE_MOST:
                continue
            ros = factory.decoder_for(channel.message_encoding, schema)(message.data)
            if not tables or not schema.name.startswith("randt_msgs/"):
                continue
            if channel.topic not in rows:
                stem = channel.topic.replace("/", "_")
                rows[channel.topic] = csv.DictReader(open(tables / f"{stem}.csv"))
                of_items = tables / f"{stem}.items.csv"
                items[channel.topic] = csv.DictReader(open(of_items)) if of_items.exists() else None
            codes = {}
            for line in schema.data.decode().splitlines():
                if "=" in line and " " in line and not line.startswith("="):
                    constant, code = line.split(" ")[1].split("=")
                    for at in range(len(constant)):
                        codes.setdefault(int(code), set()).add(
                            constant[at:].lower().replace("_", "-")
                        )
            values = plain(ros)
            behind = values.pop("items", None)
            row = next(rows[channel.topic])
            seen = dict(columns(values))
            if behind is not None:
                assert int(row.pop("items")) == len(behind), channel.topic
            assert set(row) == set(seen), (channel.topic, set(row) ^ set(seen))
            for name, value in seen.items():
                assert is_same(row[name], value, codes), (channel.topic, name, row[name], value)
            for item in behind or []:
                row = next(items[channel.topic])
                for name, value in columns(item) if isinstance(item, dict) else [("value", item)]:
                    assert is_same(row[name], value, codes), (channel.topic, name, row[name], value)
    for table in [*rows.values(), *filter(None, items.values())]:
        assert next(table, None) is None, "a table has more than the log"
    return found


def again(path, dump):
    """By rosbags: every message is what it writes again. Gives how many there are by topic."""
    found = Counter()
    topics = {}
    with AnyReader([Path(path)]) as reader:
        is_ros2 = reader.is2
        standard = HUMBLE if is_ros2 else NOETIC
        for connection in reader.connections:
            is_late = connection.topic in LATCHED
            if not is_ros2:
                assert bool(connection.ext.latching) == is_late, connection
                is_known = connection.msgtype in standard.fielddefs
                store = standard if is_known else reader.typestore
                _, md5 = store.generate_msgdef(connection.msgtype, ros_version=1)
                assert connection.digest == md5, (connection.msgtype, md5)
            elif not connection.msgtype.startswith("randt_msgs/"):
                qos = connection.ext.offered_qos_profiles
                kept = [profile.durability.name for profile in qos]
                assert kept == (["TRANSIENT_LOCAL"] if is_late else []), connection.topic
        for connection, _, raw in reader.messages():
            kind = connection.msgtype
            found[connection.topic] += 1
            if len(raw) > LARGE and found[connection.topic] > LARGE_MOST:
                continue
            stores = [store for store in [reader.typestore, standard] if kind in store.fielddefs]
            for store in stores:
                if is_ros2:
                    written = store.serialize_cdr(store.deserialize_cdr(raw, kind), kind)
                else:
                    written = store.serialize_ros1(store.deserialize_ros1(raw, kind), kind)
                assert bytes(written) == bytes(raw), (connection.topic, kind)
            topic = topics.setdefault(connection.topic, [connection.msgdef.data, []])
            if len(topic[1]) < LARGE_MOST:
                topic[1].append(base64.b64encode(raw).decode())
    if dump and is_ros2:
        dump.writelines(json.dumps([t, *rest]) + "\n" for t, rest in topics.items())
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("logs", nargs="+")
    parser.add_argument("--tables", type=Path)
    parser.add_argument("--dump", type=Path)
    arguments = parser.parse_args()
    dump = open(arguments.dump, "w") if arguments.dump else None
    for path in arguments.logs:
        found = again(path, dump)
        if Path(path).suffix == ".mcap":
            assert read(path, arguments.tables) == found, path
        print(path, dict(found))


main()
