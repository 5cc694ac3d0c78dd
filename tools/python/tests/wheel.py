"""A wheel with programs, as pip installs it: stand-ins for the programs and the extension."""

import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

OWN = Path(__file__).parents[1]
PROGRAMS = (OWN / "../../systemd/package/programs").resolve().read_text().split()

with tempfile.TemporaryDirectory() as temporary:
    folder = Path(temporary)
    built = folder / "release"
    built.mkdir()
    for program in PROGRAMS:
        shutil.copy("/bin/echo", built / program)
    files = {
        "randt/__init__.py": "",
        "randt/__main__.py": (OWN / "randt/__main__.py").read_text(),
        "randt/_randt.py": "def main(arguments): raise SystemExit('not the program')\n",
        "randt-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: randt\nVersion: 1\n",
        "randt-1.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        "randt-1.dist-info/entry_points.txt": "[console_scripts]\nrandt=randt.__main__:main\n",
    }
    files["randt-1.dist-info/RECORD"] = "".join(f"{name},,\n" for name in files)
    wheel = folder / "randt-1-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    # Again, as after another build: the programs of before are replaced.
    for _ in range(2):
        subprocess.run([sys.executable, OWN / "add_programs.py", wheel, built], check=True)
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert len(set(names)) == len(names), names
    installed = folder / "installed"
    install = ["install", "--quiet", "--no-deps", "--no-index", "--target", installed, wheel]
    subprocess.run([sys.executable, "-m", "pip", *install], check=True)
    printed = subprocess.run(
        [sys.executable, "-m", "randt", "up", "--view"],
        cwd=installed,
        capture_output=True,
        text=True,
        check=True,
    )
    assert printed.stdout == "up --view\n", printed
    for program in PROGRAMS:
        subprocess.run([installed / "randt/programs" / program], check=True)
        listed = (installed / "randt-1.dist-info/RECORD").read_text()
        assert listed.count(f"randt/programs/{program},sha256=") == 1, listed
