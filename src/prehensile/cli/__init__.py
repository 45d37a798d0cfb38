"""The ``prehensile`` command. See :mod:`prehensile.cli.main`."""
