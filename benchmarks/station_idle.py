"""How much of the simulation's speed a station costs while it does nothing.

Three sides simulate the same scenario file, each in a process of its own: `ours` is
`prehensile.station.build`; `bare` a plain Drake diagram with the same plant and Drake's own driver
systems, without guard, ports or cameras; `peer` is `MakeHardwareStation` of the PyPI package
`manipulation`. They take turns of one simulated second each. The real-time factor counts the
process's own CPU seconds (one thread), so that other load on the machine does not enter; the
ratios are medians over the rounds, with their quartiles.

    python benchmarks/station_idle.py [--rounds 11] [--peer PYTHON] [--drake-models FOLDER]

PYTHON is the interpreter of a virtual environment with `manipulation` (and the same Drake), and
FOLDER holds Drake's model package. Without FOLDER only our embedded scenario is run, without
PYTHON only two sides.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parent / "src"
FILE = HERE / "station_idle.yaml"
EMBEDDED = "two_bins"


def main() -> int:
    """Runs the benchmark and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=11)
    parser.add_argument("--seconds", type=float, default=1.0, help="simulated, per turn")
    parser.add_argument("--peer", default=os.environ.get("PREHENSILE_PEER_MANIPULATION"))
    shared = HERE.parent.parent / "shared" / "drake_models"
    parser.add_argument("--drake-models", type=Path, default=shared if shared.is_dir() else None)
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return work(**json.loads(args.worker))
    models = str(args.drake_models) if args.drake_models else ""
    jobs = [(EMBEDDED, None, ["bare", "ours"]), (EMBEDDED, 0.001, ["bare", "ours"])]
    if models:
        sides = ["bare", "ours", *(["peer"] if args.peer else [])]
        jobs = [(str(FILE), 0.001, sides), (str(FILE), 0.005, sides), *jobs]
    results = []
    print(f"{'scenario':<20} {'step':>7} {'side':<6} {'RTF':>7}   ours / side (quartiles)")
    for scenario, time_step, sides in jobs:
        workers = {
            side: start(side, args.peer, scenario, time_step, models, args.seconds)
            for side in sides
        }
        steps = {side: turn(worker)["time_step"] for side, worker in workers.items()}
        seconds = {side: [] for side in sides}
        for _ in range(args.rounds):
            for side, worker in workers.items():
                seconds[side].append(turn(worker)["cpu"] / args.seconds)
        for worker in workers.values():
            worker.communicate("stop\n")
        for side in sides:
            ratios = [t / ours for t, ours in zip(seconds[side], seconds["ours"], strict=True)]
            low, median, high = (quantile(ratios, p) for p in (0.25, 0.5, 0.75))
            rtf = 1 / quantile(seconds[side], 0.5)
            name, step = Path(scenario).stem, steps[side]
            print(
                f"{name:<20} {step:>7g} {side:<6} {rtf:>7.2f}"
                + ("" if side == "ours" else f"   {median:.2f} ({low:.2f} to {high:.2f})"),
                flush=True,
            )
            results.append(
                {"scenario": name, "time_step": step, "side": side, "rtf": rtf, "ours/side": median}
            )
    if args.json:
        args.json.write_text(json.dumps(results, indent=1))
    return 0


def quantile(values: list[float], p: float) -> float:
    """The p-quantile by linear interpolation."""
    ordered = sorted(values)
    place = p * (len(ordered) - 1)
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


def start(
    side: str, peer: str, scenario: str, time_step: float | None, models: str, seconds: float
) -> subprocess.Popen:
    """Starts the process of one side."""
    job = {
        "side": side,
        "scenario": scenario,
        "time_step": time_step,
        "models": models,
        "seconds": seconds,
    }
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    if side == "peer":
        environment.pop("PYTHONPATH", None)
    python = peer if side == "peer" else sys.executable
    return subprocess.Popen(
        [python, __file__, "--worker", json.dumps(job)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )


def turn(worker: subprocess.Popen) -> dict:
    """Lets a side simulate for one turn."""
    worker.stdin.write("go\n")
    worker.stdin.flush()
    line = worker.stdout.readline()
    if not line:
        raise SystemExit(f"a side of the benchmark died: {worker.args}")
    return json.loads(line)


def work(side: str, scenario: str, time_step: float | None, models: str, seconds: float) -> int:
    """What the process of one side does: simulate for a turn whenever it is told to."""
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import ConstantVectorSource

    make = {"ours": make_ours, "bare": make_bare, "peer": make_peer}[side]
    loaded, station = make(scenario, time_step, models)
    builder = DiagramBuilder()
    builder.AddSystem(station)
    default = station.CreateDefaultContext()
    if station.HasOutputPort("iiwa.position_measured"):
        q = station.GetOutputPort("iiwa.position_measured").Eval(default)
        width = station.GetOutputPort("wsg.state_measured").Eval(default)[:1]
    for port, value in (("iiwa.position", q), ("wsg.position", width), ("iiwa.torque", 0 * q)):
        if station.HasInputPort(port):
            source = builder.AddSystem(ConstantVectorSource(value))
            builder.Connect(source.get_output_port(), station.GetInputPort(port))
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(loaded.simulator_config, simulator)
    simulator.set_target_realtime_rate(0.0)
    until = 0.0
    for line in sys.stdin:
        if line.strip() != "go":
            break
        until += seconds
        began = time.process_time()
        simulator.AdvanceTo(until)
        cpu = time.process_time() - began
        print(json.dumps({"cpu": cpu, "time_step": loaded.plant_config.time_step}), flush=True)
    return 0


def load_ours(scenario: str, time_step: float | None, models: str):
    """Reads the scenario by our reader."""
    sys.path.insert(0, str(SOURCE))
    from prehensile.station.scenario_file import load_scenario

    loaded = load_scenario(scenario, packages={"drake_models": models} if models else None)
    if time_step:
        loaded.plant_config.time_step = time_step
    return loaded


def make_ours(scenario: str, time_step: float | None, models: str):
    """Our station."""
    loaded = load_ours(scenario, time_step, models)
    from prehensile.station.build import build

    return loaded, build(loaded)


def make_bare(scenario: str, time_step: float | None, models: str):
    """The same plant with nothing but Drake's own driver systems."""
    loaded = load_ours(scenario, time_step, models)
    from pydrake.manipulation import (
        MakeMultibodyStateToWsgStateSystem,
        SchunkWsgPositionController,
        SimIiwaDriver,
    )
    from pydrake.planning import RobotDiagramBuilder
    from pydrake.systems.primitives import SharedPointerSystem

    from prehensile.station.robot_plant import add_models, make_robot_plant

    robot_builder = RobotDiagramBuilder(time_step=loaded.plant_config.time_step)
    builder, plant = robot_builder.builder(), robot_builder.plant()
    robot_builder.scene_graph().set_config(loaded.scene_graph_config)
    add_models(loaded, plant)
    plant.Finalize()
    controller_plant = make_robot_plant(loaded, ["iiwa"], frozen_children=True)
    builder.AddSystem(SharedPointerSystem(controller_plant))
    arm = SimIiwaDriver.AddToBuilder(
        builder,
        plant,
        plant.GetModelInstanceByName("iiwa"),
        loaded.model_drivers["iiwa"],
        controller_plant,
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
    return loaded, robot_builder.Build()


def make_peer(scenario: str, time_step: float, models: str):
    """The peer's station; the wheel of Drake would have to download the models."""
    from manipulation.station import LoadScenario, MakeHardwareStation

    def use_local_models(parser) -> None:
        parser.package_map().Remove("drake_models")
        parser.package_map().Add("drake_models", models)

    loaded = LoadScenario(filename=scenario)
    loaded.plant_config.time_step = time_step
    return loaded, MakeHardwareStation(loaded, parser_preload_callback=use_local_models)


if __name__ == "__main__":
    sys.exit(main())
