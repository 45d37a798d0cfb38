"""Scenarios, and the stations that are built from them."""
