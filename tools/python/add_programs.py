"""Puts the programs into a wheel, beside the package's files: add_programs.py WHEEL FOLDER

FOLDER is where Cargo has put them (target/release). The wheel's own `randt` starts them then
(randt/__main__.py), and `randt up` finds the stages beside it."""

import base64
import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

wheel, folder = Path(sys.argv[1]), Path(sys.argv[2])
repository = Path(__file__).parents[2]
programs = (repository / "systemd/package/programs").read_text().split()

with zipfile.ZipFile(wheel) as old:
    # Those of an earlier time are replaced.
    own = [item for item in old.infolist() if not item.filename.startswith("randt/programs/")]
    files = {item: old.read(item) for item in own}
(record,) = [item for item in files if item.filename.endswith(".dist-info/RECORD")]
lines = files.pop(record).decode().splitlines()
lines = [line for line in lines if not line.startswith("randt/programs/")]
with tempfile.TemporaryDirectory() as temporary:
    for program in programs:
        path = Path(temporary) / program
        # Without the symbols, which are most of it.
        subprocess.run(["strip", "-o", path, folder / program], check=True)
        item = zipfile.ZipInfo(f"randt/programs/{program}")
        item.compress_type = zipfile.ZIP_DEFLATED
        # pip and others keep the right to be run.
        item.external_attr = 0o100755 << 16
        files[item] = path.read_bytes()
        digest = base64.urlsafe_b64encode(hashlib.sha256(files[item]).digest()).rstrip(b"=")
        lines.append(f"{item.filename},sha256={digest.decode()},{len(files[item])}")
files[record] = "".join(f"{line}\n" for line in lines).encode()
part = wheel.with_suffix(".part")
with zipfile.ZipFile(part, "w") as new:
    for item, content in files.items():
        new.writestr(item, content)
part.replace(wheel)
print(f"{wheel}: {len(programs)} programs, {wheel.stat().st_size / 1e6:.1f} MB")
