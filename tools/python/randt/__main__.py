"""The program `randt`: `python -m randt run DRIVE.bag --out DIR`."""

import os
import sys
from pathlib import Path

from randt import _randt

# Where tools/python/add_programs.py puts the programs: `randt up` looks for the stages beside its
# own.
PROGRAM = Path(__file__).with_name("programs") / "randt"


def main() -> int:
    """Runs the command line of this process; gives its exit code."""
    if PROGRAM.is_file():
        os.execv(PROGRAM, ["randt", *sys.argv[1:]])
    return _randt.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
