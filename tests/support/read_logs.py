"""Reads exports for viewers by the mcap package and decodes what is for viewers by the official schemas. Says what it found."""

import sys
from collections import Counter
from importlib import import_module

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

OFFICIAL = ["PoseInFrame", "FrameTransforms", "PointCloud", "Grid", "SceneUpdate", "Log"]


def read(path):
    found = Counter()
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        records = [record.name for record in reader.iter_metadata()]
        assert "randt/robot" in records and "randt/config" in records, records
        for schema, channel, message in reader.iter_messages():
            found[channel.topic] += 1
            package, name = schema.name.split(".")
            assert package == "foxglove" and name in OFFICIAL, schema.name
            module = import_module(f"foxglove_schemas_protobuf.{name}_pb2")
            official = getattr(module, name)()
            official.ParseFromString(message.data)
            # Nothing that the official schema does not know: it writes the same again.
            assert official.SerializeToString(deterministic=True) == message.data, schema.name
            # The schema in the file says the same as the official one.
            decoder = DecoderFactory().decoder_for(channel.message_encoding, schema)
            assert str(decoder(message.data)) == str(official), schema.name
            if name == "PointCloud":
                assert len(official.data) % official.point_stride == 0
                assert [field.name for field in official.fields] == ["x", "y", "z", "intensity"]
            if name == "Grid":
                assert len(official.data) % official.row_stride == 0
            if name == "SceneUpdate":
                for line in (line for entity in official.entities for line in entity.lines):
                    assert not line.colors or len(line.colors) == len(line.points)
                    assert all(index < len(line.points) for index in line.indices)
        counts = summary.statistics.channel_message_counts
        stored = Counter()
        for channel, count in counts.items():
            stored[summary.channels[channel].topic] += count
        assert stored == found, (stored, found)
    assert all(found[topic] for topic in ["view/pose", "view/transforms", "view/points"]), found
    return found


for path in sys.argv[1:]:
    print(path, dict(read(path)))
