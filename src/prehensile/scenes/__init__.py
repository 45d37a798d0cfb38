"""Random scenes: clutter in a bin."""
