"""``python -m prehensile.models.generate [NAME ...] [--out FOLDER]``."""

import argparse
import sys
import time
from pathlib import Path

from prehensile.errors import InputError
from prehensile.models.generate import DATA, generate, generators


def main() -> int:
    """Generates the named models, or all; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m prehensile.models.generate", description="Write the embedded models."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="models (default: all)")
    parser.add_argument("--out", type=Path, default=DATA, help="folder (default: models/data)")
    args = parser.parse_args()
    try:
        for name in args.names or generators():
            start = time.perf_counter()
            folder = generate(name, args.out)
            size = sum(f.stat().st_size for f in folder.iterdir() if f.is_file())
            print(f"{name}: {size / 1024:.0f} KiB in {time.perf_counter() - start:.1f} s")
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
