"""Household objects with the dimensions and masses of the YCB set."""
