"""Scenarios, and the stations that are built from them."""

from prehensile.station.build import build
from prehensile.station.scenario import Scenario
from prehensile.station.scenario_file import list_scenarios, load_scenario, loads_scenario

__all__ = ["Scenario", "build", "list_scenarios", "load_scenario", "loads_scenario"]
