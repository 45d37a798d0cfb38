"""``prehensile reach``: make, save and look at a map of what an arm reaches."""

import argparse
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import Frame

    from prehensile.kinematics.reachability import ReachabilityConfig, ReachabilityMap

# Choice: what it is, in words.
_VALUES = {
    "index": "reachability index (share of approach directions)",
    "manipulability": "manipulability at best",
    "singular-value": "smallest singular value at best (1/s)",
    "count": "configurations",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments of ``prehensile reach``."""
    from prehensile.cli.run import add_page_arguments

    parser.description = (
        "Tries random configurations within the joint limits and notes, voxel by voxel, how often "
        "a frame gets there, from which directions, and how freely it moves. Without --output, "
        "--picture or --view the map goes to MODEL_reach.npz."
    )
    parser.add_argument(
        "what",
        metavar="MODEL|SCENARIO|FILE",
        help="a model or scenario as for 'prehensile view', or a map in a .npz file",
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="write the map (.npz)")
    parser.add_argument("--picture", metavar="FILE", help="write slices through the map (.png)")
    parser.add_argument("--view", action="store_true", help="look at the map in the browser")
    parser.add_argument(
        "--value", choices=_VALUES, default="index", help="what colours tell (default: index)"
    )
    parser.add_argument(
        "--at", nargs=2, type=float, default=(0.0, 0.4), metavar=("Y", "Z"),
        help="where --picture cuts, and --view at y (default: 0 0.4, in m)",
    )  # fmt: skip
    parser.add_argument(
        "--duration", type=float, default=math.inf, metavar="S",
        help="stop --view after so many seconds",
    )  # fmt: skip
    making = parser.add_argument_group("making a map")
    making.add_argument("--frame", help="the frame that is to reach (default: the last link)")
    making.add_argument(
        "--axis", nargs=3, type=float, default=(0.0, 0.0, 1.0), metavar=("X", "Y", "Z"),
        help="its approach axis (default: 0 0 1)",
    )  # fmt: skip
    making.add_argument("--samples", type=float, default=1e7, metavar="N", help="default: 1e7")
    making.add_argument(
        "--voxel", type=float, default=0.05, metavar="M", help="edge of a voxel (default: 0.05 m)"
    )
    making.add_argument(
        "--directions", type=int, default=64, metavar="N",
        help="approach directions told apart, 1 to 64 (default: 64)",
    )  # fmt: skip
    making.add_argument(
        "--length", type=float, default=0.5, metavar="M",
        help="characteristic length that makes m/s and rad/s comparable (default: 0.5 m)",
    )  # fmt: skip
    making.add_argument("--seed", type=int, default=0, help="default: 0")
    making.add_argument(
        "--threads", type=int, default=os.cpu_count() or 1, metavar="N",
        help="default: all processors; they do not change the map",
    )  # fmt: skip
    add_page_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Runs ``prehensile reach``."""
    from prehensile.errors import Finding, InputError
    from prehensile.kinematics.reachability import load_map, save_map

    source, output = Path(args.what), args.output
    for option, path, suffix in (("--output", output, ".npz"), ("--picture", args.picture, ".png")):
        if path is not None and Path(path).suffix != suffix:
            raise InputError(Finding(f"{path} does not end in {suffix}", key=option))
    if not all(map(math.isfinite, args.at)):
        raise InputError(Finding("must be two numbers in m", key="--at"))
    if source.suffix == ".npz":
        reach = load_map(source)
    else:
        reach = _make(args)
        if not (output or args.picture or args.view):
            output = f"{source.stem}_reach.npz"
    share = reach.index()[reach.counts > 0]
    print(
        f"{reach.frame}: {reach.num_samples} configurations reach {len(share)} voxels of "
        f"{reach.voxel_size:g} m, {reach.volume():.3g} m³; reachability index "
        f"{share.mean() if len(share) else 0:.2f} on average"
    )
    if output:
        save_map(Path(output), reach)
        print(output)
    if args.picture:
        _picture(args, reach)
        print(args.picture)
    if args.view:
        _view(args, reach)
    return 0


def _make(args: argparse.Namespace) -> "ReachabilityMap":
    from pydrake.multibody.plant import MultibodyPlant

    from prehensile.cli.view import find
    from prehensile.errors import Finding, InputError
    from prehensile.kinematics.reachability import reachability_map
    from prehensile.kinematics.tree import joints_that_move, tree_from_plant
    from prehensile.station.robot_plant import add_models, finalize
    from prehensile.viz.progress import progress

    config = _config(args)
    scenario = find(args.what)
    plant = MultibodyPlant(scenario.plant_config.time_step)
    add_models(scenario, plant)
    finalize(scenario, plant)
    frame = _frame(plant, args.frame)
    joints = joints_that_move(plant, frame)
    if not joints:
        raise InputError(Finding(f"no joint moves the frame {frame.name()}", key="--frame"))
    compiled = tree_from_plant(plant, [frame], joints=joints)
    with progress(f"moving {frame.name()}", total=config.num_samples) as report:
        try:
            return reachability_map(
                compiled,
                config,
                num_threads=args.threads,
                on_progress=lambda done: report(done, f"{done} configurations"),
            )
        except ValueError as error:
            raise InputError(str(error)) from error


def _config(args: argparse.Namespace) -> "ReachabilityConfig":
    from prehensile.errors import Finding, InputError
    from prehensile.kinematics.reachability import ReachabilityConfig

    if args.threads < 1:
        raise InputError(Finding(f"must be at least 1, not {args.threads}", key="--threads"))
    if not 1 <= args.samples <= 1e12:
        raise InputError(Finding(f"must be 1 to 1e12, not {args.samples:g}", key="--samples"))
    try:
        return ReachabilityConfig(
            num_samples=int(args.samples),
            voxel_size=args.voxel,
            num_directions=args.directions,
            axis=tuple(args.axis),
            length=args.length,
            seed=args.seed,
        )
    except ValueError as error:
        raise InputError(str(error)) from error


def _frame(plant: "MultibodyPlant", name: str | None) -> "Frame":
    """The frame of that name, or of the one last link that more joints move than any other."""
    from pydrake.multibody.parsing import GetScopedFrameByName
    from pydrake.multibody.tree import BodyIndex

    from prehensile.errors import Finding, InputError
    from prehensile.kinematics.tree import joints_that_move
    from prehensile.yaml_lines import close_to

    links = [plant.get_body(BodyIndex(i)).body_frame() for i in range(1, plant.num_bodies())]
    if name is not None:
        try:
            return GetScopedFrameByName(plant, name)
        except RuntimeError as error:
            mend = close_to(name, [link.name() for link in links])
            raise InputError(
                Finding(f"no frame is called '{name}'", mend, key="--frame")
            ) from error
    movers = [[joint.index() for joint in joints_that_move(plant, link)] for link in links]
    most = max(map(len, movers), default=0)
    last = [i for i, joints in enumerate(movers) if len(joints) == most]
    # Links welded to each other are moved by the same joints: the first of them.
    if not last or any(movers[i] != movers[last[0]] for i in last):
        names = ", ".join(links[i].name() for i in last)
        finding = Finding("there is no single last link", f"name one of {names}", key="--frame")
        raise InputError(finding)
    return links[last[0]]


def _values(args: argparse.Namespace, reach: "ReachabilityMap") -> "NDArray[np.float64]":
    """(nx, ny, nz) what the colours tell; NaN where nothing was reached."""
    import numpy as np

    match args.value:
        case "index":
            values = reach.index()
        case "manipulability":
            values = reach.manipulability
        case "singular-value":
            values = reach.singular_value
        case _:
            values = reach.counts
    return np.where(reach.counts > 0, values, np.nan)


def _picture(args: argparse.Namespace, reach: "ReachabilityMap") -> None:
    from prehensile.viz.figures import save_figure
    from prehensile.viz.voxels import plot_slices

    values = _values(args, reach)
    figure = plot_slices(
        values, reach.first, reach.voxel_size, label=_VALUES[args.value], at=tuple(args.at)
    )
    path = Path(args.picture)
    save_figure(figure, path.stem, path.parent)


def _view(args: argparse.Namespace, reach: "ReachabilityMap") -> None:
    """Shows the half of the map behind the cut, until Ctrl-C or the button."""
    import time

    import numpy as np

    from prehensile.viz.live import STOP_BUTTON, STOP_KEY
    from prehensile.viz.meshcat import start_meshcat
    from prehensile.viz.voxels import draw_voxels

    meshcat = start_meshcat(port=args.port, open_browser=not args.no_browser)
    values = _values(args, reach)
    draw_voxels(
        meshcat,
        "reachability",
        values[:, reach.centers()[1] <= args.at[0]],
        reach.first,
        reach.voxel_size,
        limits=(0.0, float(np.nanmax(values, initial=0.0))),
    )
    meshcat.AddButton(STOP_BUTTON, STOP_KEY)
    hint = "stop: the Stop button, Escape in the page, or Ctrl-C"
    print(f"look at {meshcat.web_url()}  ({hint})", flush=True)
    end = time.monotonic() + args.duration
    while meshcat.GetButtonClicks(STOP_BUTTON) == 0 and time.monotonic() < end:
        time.sleep(0.1)
