"""What a station costs while it does nothing: real-time factors beside bare Drake and the peer.

``bare Drake`` is a diagram of the same plant with Drake's own driver systems: no guard, no ports,
no cameras. All sides get constant commands and the simulator settings of the scenario. The
real-time factor counts the process's own CPU seconds (one thread), so that other load on the
machine enters as little as it can.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks.framework import ROOT, Contender, Results, Samples

TITLE = "Idle station with arm, hand and cameras: simulated seconds per CPU second"
REPEATS = 7
PUBLIC, EMBEDDED = "public models", "two_bins"


def prepare(folder: Path) -> None:
    """Writes the cases: (scenario, time step or None for the file's), and the packages."""
    from prehensile.models.packages import find_packages

    models = find_packages().get("drake_models", ROOT.parent / "shared" / "drake_models")
    cases: dict[str, tuple[str, float | None]] = {}
    if models.is_dir():
        scenario = str(ROOT / "benchmarks" / "station_idle.yaml")
        cases |= {f"{PUBLIC}, {1e3 * h:g} ms": (scenario, h) for h in (0.001, 0.005)}
    cases |= {f"{EMBEDDED}, 1 ms": (EMBEDDED, 0.001), f"{EMBEDDED}, as shipped": (EMBEDDED, None)}
    (folder / "cases.json").write_text(json.dumps({"models": str(models), "cases": cases}))


def measure(station: Any, config: Any) -> Samples:
    """Real-time factors of a station that is told to stay where it is."""
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import ConstantVectorSource

    builder = DiagramBuilder()
    builder.AddSystem(station)
    default = station.CreateDefaultContext()
    q = station.GetOutputPort("iiwa.position_measured").Eval(default)
    width = station.GetOutputPort("wsg.state_measured").Eval(default)[:1]
    for port, value in (("iiwa.position", q), ("wsg.position", width), ("iiwa.torque", 0 * q)):
        if station.HasInputPort(port):
            source = builder.AddSystem(ConstantVectorSource(value))
            builder.Connect(source.get_output_port(), station.GetInputPort(port))
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(config, simulator)
    simulator.set_target_realtime_rate(0.0)
    simulator.AdvanceTo(1.0)
    factors = []
    for k in range(REPEATS):
        began = time.process_time()
        simulator.AdvanceTo(2.0 + k)
        factors.append(1.0 / (time.process_time() - began))
    return Samples(factors, "x real time", more_is_better=True)


def _cases(folder: Path) -> tuple[str, dict[str, tuple[str, float | None]]]:
    read = json.loads((folder / "cases.json").read_text())
    return read["models"], read["cases"]


def _load(scenario: str, time_step: float | None, models: str) -> Any:
    from prehensile.station.scenario_file import load_scenario

    packages = {"drake_models": models} if scenario != EMBEDDED else None
    loaded = load_scenario(scenario, packages=packages)
    if time_step is not None:
        loaded.plant_config.time_step = time_step
    return loaded


def ours(folder: Path) -> Results:
    """``prehensile.station.build``."""
    from prehensile.station.build import build

    models, cases = _cases(folder)
    results = {}
    for case, (name, time_step) in cases.items():
        scenario = _load(name, time_step, models)
        results[case] = measure(build(scenario), scenario.simulator_config)
    return results


def bare(folder: Path) -> Results:
    """The same plant with nothing but Drake's own driver systems."""
    from pydrake.manipulation import (
        MakeMultibodyStateToWsgStateSystem,
        SchunkWsgPositionController,
        SimIiwaDriver,
    )
    from pydrake.planning import RobotDiagramBuilder
    from pydrake.systems.primitives import SharedPointerSystem

    from prehensile.station.robot_plant import add_models, make_robot_plant

    models, cases = _cases(folder)
    results = {}
    for case, (name, time_step) in cases.items():
        scenario = _load(name, time_step, models)
        robot_builder = RobotDiagramBuilder(time_step=scenario.plant_config.time_step)
        builder, plant = robot_builder.builder(), robot_builder.plant()
        robot_builder.scene_graph().set_config(scenario.scene_graph_config)
        add_models(scenario, plant)
        plant.Finalize()
        controller_plant = make_robot_plant(scenario, ["iiwa"], frozen_children=True)
        builder.AddSystem(SharedPointerSystem(controller_plant))
        arm = SimIiwaDriver.AddToBuilder(
            builder=builder,
            plant=plant,
            iiwa_instance=plant.GetModelInstanceByName("iiwa"),
            driver_config=scenario.model_drivers["iiwa"],
            controller_plant=controller_plant,
        )
        instance = plant.GetModelInstanceByName("wsg")
        hand = builder.AddSystem(SchunkWsgPositionController())
        state = builder.AddSystem(MakeMultibodyStateToWsgStateSystem())
        builder.Connect(plant.get_state_output_port(instance), hand.get_state_input_port())
        builder.Connect(plant.get_state_output_port(instance), state.get_input_port())
        builder.Connect(
            hand.get_generalized_force_output_port(), plant.get_actuation_input_port(instance)
        )
        builder.ExportInput(arm.GetInputPort("position"), "iiwa.position")
        builder.ExportInput(arm.GetInputPort("torque"), "iiwa.torque")
        builder.ExportOutput(arm.GetOutputPort("position_measured"), "iiwa.position_measured")
        builder.ExportInput(hand.get_desired_position_input_port(), "wsg.position")
        builder.ExportOutput(state.get_output_port(), "wsg.state_measured")
        results[case] = measure(robot_builder.Build(), scenario.simulator_config)
    return results


def peer(folder: Path) -> Results:
    """``manipulation.station.MakeHardwareStation``, where Drake's model package is to be had."""
    from manipulation.station import (  # pyright: ignore[reportMissingImports]
        LoadScenario,
        MakeHardwareStation,
    )

    models, cases = _cases(folder)

    def use_local_models(parser: Any) -> None:
        # Drake would download the package.
        parser.package_map().Remove("drake_models")
        parser.package_map().Add("drake_models", models)

    results = {}
    for case, (name, time_step) in cases.items():
        if name == EMBEDDED:
            continue
        scenario = LoadScenario(filename=name)
        scenario.plant_config.time_step = time_step
        station = MakeHardwareStation(scenario, parser_preload_callback=use_local_models)
        results[case] = measure(station, scenario.simulator_config)
    if not results:
        sys.exit("Drake's public models are not on this machine")
    return results


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("bare Drake", bare),
    Contender("manipulation", peer, requirements=("manipulation==2026.10.17", "drake==1.51.1")),
)
