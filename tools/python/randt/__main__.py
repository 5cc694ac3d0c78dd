"""The program `randt`: `python -m randt run DRIVE.bag --out DIR`."""

import sys

from randt import _randt


def main() -> int:
    """Runs the command line of this process; gives its exit code."""
    return _randt.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
