"""A Meshcat server that only this machine can reach, with a camera and light that suit a station.

Meshcat is the browser viewer that Drake talks to. Drake binds it to every network interface
unless told otherwise; ours listens on 127.0.0.1 alone.
"""

import webbrowser

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from prehensile.errors import Finding, InputError

# Where Drake starts to look for a free port, and how many it tries.
_FIRST_PORT, _NUM_PORTS = 7000, 1000


def start_meshcat(*, port: int | None = None, open_browser: bool = False) -> Meshcat:
    """Starts a Meshcat server on the loopback interface.

    Args:
        port: TCP port to listen on, 1024 to 65535; default: the first free one from 7000 on.
        open_browser: also open the page in the user's browser. A machine without a browser is
            no error: the address can be read from ``meshcat.web_url()``.

    Returns:
        The server. It runs until the object is destroyed.

    Raises:
        InputError: the port is out of range or taken, or no port is free.
    """
    if port is not None and not 1024 <= port <= 65535:  # Drake ends the process below
        raise InputError(Finding(f"{port} is not a TCP port", "take one from 1024 to 65535"))
    try:
        meshcat = Meshcat(
            MeshcatParams(host="localhost", port=port, initial_properties=_initial_properties())
        )
    except RuntimeError as error:
        if "port" not in str(error):
            raise
        if port is None:
            last = _FIRST_PORT + _NUM_PORTS - 1
            message, mend = f"no port from {_FIRST_PORT} to {last} is free", "name one with --port"
        else:
            message, mend = f"port {port} is taken or not allowed", "name another, or none at all"
        raise InputError(Finding(message, mend)) from error
    look_at_workspace(meshcat)
    if open_browser:
        webbrowser.open(meshcat.web_url())
    return meshcat


def look_at_workspace(meshcat: Meshcat) -> None:
    """Puts the viewer's eye in front of a table-top station whose arm stands at the origin.

    Args:
        meshcat: the server whose camera is set, for pages open now and later.
    """
    meshcat.SetCameraPose(np.array([1.45, 0.87, 0.98]), np.array([0.32, 0.0, 0.18]))


def _initial_properties() -> list[MeshcatParams.PropertyTuple]:
    def prop(path: str, name: str, value: list[float] | float) -> MeshcatParams.PropertyTuple:
        return MeshcatParams.PropertyTuple(path=path, property=name, value=value)

    return [
        # A table top at z = 0 would flicker through the grid that Meshcat draws there.
        prop("/Grid", "visible", False),
        prop("/Axes", "visible", False),
        prop("/Background/<object>", "top_color", [0.93, 0.95, 0.97]),
        prop("/Background/<object>", "bottom_color", [0.66, 0.70, 0.74]),
        # Meshcat's own lights burn white paint out.
        prop("/Lights/SpotLight/<object>", "intensity", 10.0),
        prop("/Lights/PointLightNegativeX/<object>", "intensity", 6.0),
        prop("/Lights/PointLightPositiveX/<object>", "intensity", 6.0),
        prop("/Lights/AmbientLight/<object>", "intensity", 0.25),
        prop("/Lights/FillLight/<object>", "intensity", 0.45),
    ]
