"""Drivers: what stands between a robot's command ports and its joints.

A driver is a :class:`Driver`: a configuration type, whose name is its tag in a scenario file
(``model_drivers: {iiwa: !IiwaDriver {...}}``), and the functions that put it into a station. More
of them come from other packages by an entry point of the group ``prehensile.drivers``::

    [project.entry-points."prehensile.drivers"]
    MyHandDriver = "my_package.driver:DRIVER"

where ``DRIVER`` is a :class:`Driver` and the entry point's name is that of its configuration.
"""

from functools import cache
from importlib.metadata import entry_points
from typing import Any

from prehensile.errors import Finding, InputError
from prehensile.station.drivers import iiwa, joint_control, suction, wsg, zero_force
from prehensile.station.drivers.site import Driver, Site

__all__ = ["Driver", "Site", "driver_of", "driver_types", "drivers"]

_GROUP = "prehensile.drivers"


@cache
def drivers() -> dict[str, Driver]:
    """Every driver there is, by the name of its configuration type.

    Raises:
        InputError: an entry point cannot be loaded, is not a driver, or takes a name that is
            taken.
    """
    own = (
        iiwa.DRIVER,
        wsg.DRIVER,
        joint_control.INVERSE_DYNAMICS,
        joint_control.JOINT_STIFFNESS,
        joint_control.JOINT_PID,
        suction.DRIVER,
        zero_force.DRIVER,
    )
    found = {driver.tag: driver for driver in own}
    findings = []
    for entry in entry_points(group=_GROUP):
        key = f"{_GROUP}.{entry.name}"
        try:
            driver = entry.load()
        except Exception as error:  # whatever another package's import raises
            mend = "mend or uninstall the package that brings it"
            findings.append(Finding(f"the driver cannot be loaded: {error}", mend, key=key))
            continue
        if not isinstance(driver, Driver) or driver.tag != entry.name:
            mend = "name the entry point after the configuration type of a Driver object"
            findings.append(Finding(f"'{entry.value}' is not that driver", mend, key=key))
        elif driver.tag in found:
            findings.append(Finding(f"there is a driver {driver.tag} already", "rename", key=key))
        else:
            found[driver.tag] = driver
    if findings:
        raise InputError(*findings)
    return found


def driver_types() -> dict[str, type]:
    """The configuration types of all drivers, by tag without the ``!`` (the type's name)."""
    return {tag: driver.config for tag, driver in drivers().items()}


def driver_of(config: Any, key: str = "") -> Driver:
    """The driver that a configuration object belongs to.

    Args:
        config: such as an ``IiwaDriver``.
        key: where it stands, for the error.

    Raises:
        InputError: no driver has such a configuration.
    """
    for driver in drivers().values():
        if type(config) is driver.config:
            return driver
    known = ", ".join(drivers())
    raise InputError(
        Finding(f"no driver is configured by a {type(config).__name__}", f"use {known}", key=key)
    )
