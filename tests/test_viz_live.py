"""Running in front of somebody: time, the stop button, progress, the viewer's loop."""

import io
import sys

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import EventStatus
from pydrake.systems.primitives import Integrator

from prehensile.viz.live import CLOCK, STOP_BUTTON, run_live
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.progress import progress
from prehensile.viz.sliders import Slider, add_sliders, joint_sliders, read_sliders, remove_sliders
from prehensile.viz.viewer import view


def press(meshcat: Meshcat, button: str) -> None:
    """What the page sends when a button is clicked: a map of two strings in MessagePack."""

    def text(value: str) -> bytes:
        return bytes([0xA0 + len(value)]) + value.encode()

    meshcat._InjectWebsocketMessage(
        message=b"\x82" + text("type") + text("button") + text("name") + text(button)
    )


def simulator() -> Simulator:
    simulator = Simulator(Integrator(1))
    simulator.get_system().get_input_port().FixValue(simulator.get_mutable_context(), [1.0])
    simulator.set_target_realtime_rate(0.0)
    simulator.Initialize()
    return simulator


def test_runs_until_the_time_is_up_and_cleans_the_page() -> None:
    meshcat = start_meshcat()
    notes: list[tuple[float, str]] = []
    result = run_live(simulator(), 1.3, meshcat, lambda t, note: notes.append((t, note)))
    assert result.status == "finished"
    assert result.simulated == pytest.approx(1.3, abs=1e-9)
    assert result.real_time_factor == pytest.approx(1.3 / result.wall)
    assert notes[-1][0] == pytest.approx(1.3)
    assert "1.3 of 1.3 s" in notes[-1][1]
    assert meshcat.GetButtonNames() == []
    assert meshcat.GetSliderNames() == []


def test_goes_on_from_where_the_simulator_is() -> None:
    meshcat, sim = start_meshcat(), simulator()
    run_live(sim, 0.5, meshcat)
    assert run_live(sim, 0.25, meshcat).simulated == pytest.approx(0.25)
    assert sim.get_context().get_time() == pytest.approx(0.75)


def test_stop_button_stops() -> None:
    meshcat, sim = start_meshcat(), simulator()
    clock: list[float] = []

    def monitor(context: object) -> EventStatus:
        now = sim.get_context().get_time()
        if now > 2.0 and not clock:
            clock.append(meshcat.GetSliderValue(CLOCK))
            press(meshcat, STOP_BUTTON)
        return EventStatus.DidNothing()

    sim.set_monitor(monitor)
    result = run_live(sim, np.inf, meshcat)
    assert result.status == "stopped"
    assert 2.0 < result.simulated < 2.3
    assert clock[0] == pytest.approx(2.0, abs=0.2), "the page shows the time"
    assert meshcat.GetButtonNames() == []


def test_interrupt_cleans_the_page() -> None:
    meshcat, sim = start_meshcat(), simulator()

    def interrupt(time: float, note: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_live(sim, 1.0, meshcat, interrupt)
    assert meshcat.GetButtonNames() == []
    assert meshcat.GetSliderNames() == []


def test_progress_writes_one_line_where_there_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress("counting", total=3) as report:
        for i in range(3):
            report(i + 1, f"{i + 1} [of] 3")
    lines = stream.getvalue().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("counting: 3 [of] 3 (")


def test_progress_says_how_far_it_came_when_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)

    def interrupted() -> None:
        with progress("counting") as report:
            report(1, "one")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert stream.getvalue().startswith("counting: one (")


def test_sliders_are_read_in_order_and_removed() -> None:
    meshcat = start_meshcat()
    sliders = [
        Slider("b", 0.0, 1.0, 0.1, 0.5, "KeyS", "KeyW"),
        Slider("a", -1.0, 1.0, 0.1, 0.2),
    ]
    add_sliders(meshcat, sliders)
    assert set(meshcat.GetSliderNames()) == {"a", "b (S, W)"}
    meshcat.SetSliderValue("a", 7.0)
    np.testing.assert_allclose(read_sliders(meshcat, sliders), [0.5, 1.0])
    remove_sliders(meshcat, sliders)
    remove_sliders(meshcat, sliders)
    assert meshcat.GetSliderNames() == []


_TWO_JOINTS = """<robot name="bot">
<link name="base"/>
<link name="turner"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="slider"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="continuous"><axis xyz="0 0 1"/>
  <parent link="base"/><child link="turner"/></joint>
<joint name="slide" type="prismatic"><axis xyz="1 0 0"/>
  <limit lower="-0.1" upper="0.3" effort="1" velocity="1"/>
  <parent link="turner"/><child link="slider"/></joint>
</robot>"""


def test_joints_of_two_equal_models_have_two_names() -> None:
    builder = RobotDiagramBuilder()
    builder.parser().SetAutoRenaming(True)
    for _ in range(2):
        builder.parser().AddModelsFromString(_TWO_JOINTS, "urdf")
    builder.plant().Finalize()
    q = builder.plant().GetPositions(builder.plant().CreateDefaultContext())
    names = [slider.name for _, slider in joint_sliders(builder.plant(), q)]
    assert names == ["bot turn", "bot slide", "bot_1 turn", "bot_1 slide"]


def test_viewer_moves_joints_until_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    meshcat = start_meshcat()
    builder = RobotDiagramBuilder()
    builder.parser().AddModelsFromString(_TWO_JOINTS, "urdf")
    plant = builder.plant()
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.Finalize()
    diagram = builder.Build()
    joints = joint_sliders(plant, np.zeros(2))
    assert [s.name for _, s in joints] == ["turn", "slide"]
    assert (joints[1][1].lower, joints[1][1].upper) == (-0.1, 0.3)
    assert joints[0][1].upper == pytest.approx(np.pi)

    # Meshcat answers to one thread alone: somebody acts while the viewer sleeps.
    naps = 0

    def nap(seconds: float) -> None:
        nonlocal naps
        naps += 1
        if naps == 2:
            meshcat.SetSliderValue("slide", 9.0)
        elif naps == 4:
            press(meshcat, STOP_BUTTON)

    monkeypatch.setattr("prehensile.viz.viewer.time.sleep", nap)
    spheres = {plant.GetBodyByName("slider").index(): np.array([[0.0, 0.0, 0.1, 0.05]])}
    q = view(diagram, plant, meshcat, spheres=spheres)
    assert naps == 4
    np.testing.assert_allclose(q, [0.0, 0.3], atol=1e-9)
    assert meshcat.HasPath("/drake/spheres/bot::slider/0")
    assert meshcat.GetSliderNames() == []
    assert meshcat.GetButtonNames() == []
