"""``python -m prehensile`` is the ``prehensile`` command."""

import sys

from prehensile.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
