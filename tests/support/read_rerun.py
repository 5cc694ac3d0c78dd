"""Reads logs as Rerun does: what its importer makes of a log has to have a row for every message of every topic, and what is of ROS has to be something that it draws.

read_rerun.py LOG...
"""

import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader

RERUN = Path(sys.executable).with_name("rerun")
# What Rerun draws of ours.
DRAWN = {"view/points": "Points3D", "view/pose": "InstancePoses3D", "view/transforms": "Transform3D"}
CHUNK = re.compile(r" with (\d+) rows .* - /(\S+) - data columns: \[(.*)\]")


def run(*arguments):
    return subprocess.run([RERUN, *arguments], check=True, capture_output=True, text=True).stdout


for path in sys.argv[1:]:
    messages = Counter()
    with open(path, "rb") as file:
        for _, channel, _ in make_reader(file).iter_messages():
            messages[channel.topic] += 1
    rows = Counter()
    columns = {}
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "log.rrd"
        run("mcap", "convert", path, "-o", recording)
        for line in run("rrd", "print", recording).splitlines():
            chunk = CHUNK.search(line)
            # The schemas are rows of their own.
            if chunk and "McapSchema" not in chunk[3] and not chunk[2].startswith("__"):
                rows[chunk[2]] += int(chunk[1])
                columns.setdefault(chunk[2], set()).update(chunk[3].split())
    assert set(rows) == set(messages), (path, set(rows) ^ set(messages))
    for topic, count in messages.items():
        assert rows[topic] >= count, (path, topic, rows[topic], count)
        drawn = DRAWN.get(topic)
        assert not drawn or any(c.startswith(drawn) for c in columns[topic]), (topic, columns[topic])
    print(path, dict(messages), "by Rerun")
