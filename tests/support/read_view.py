"""Decodes what randt-view sent by the official schemas: a folder with a file a message, SCHEMA.TOPIC.NUMBER. Says what it found."""

import sys
from collections import Counter
from importlib import import_module
from pathlib import Path

found = Counter()
tiles = set()
for path in sorted(Path(sys.argv[1]).iterdir()):
    package, name, topic, _ = path.name.split(".")
    assert package == "foxglove", path
    module = import_module(f"foxglove_schemas_protobuf.{name}_pb2")
    data = path.read_bytes()
    official = getattr(module, name)()
    official.ParseFromString(data)
    # Nothing that the official schema does not know: it writes the same again.
    assert official.SerializeToString(deterministic=True) == data, path
    found[topic] += 1
    if topic == "view_grid":
        for entity in official.entities:
            assert entity.frame_id == "map" and entity.id.startswith("tile "), entity
            tiles.add(entity.id)
            for mesh in entity.triangles:
                assert len(mesh.indices) % 3 == 0 and max(mesh.indices) < len(mesh.points), path
    if topic == "view_points":
        assert len(official.data) % official.point_stride == 0
# Where the link is quick enough.
found.pop("view_cells", None)
topics = "grid log path points pose status transforms".split()
assert sorted(found) == [f"view_{topic}" for topic in topics], found
print(dict(found), len(tiles), "tiles")
