"""Seeing: Meshcat, replays, camera pictures, system diagrams, progress."""
