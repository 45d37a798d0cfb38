"""The state machine runs decisions and motions at their own rates, through ports alone."""

from dataclasses import dataclass

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource, LogVectorOutput

from prehensile.behavior.state_machine import Decision, StateMachine


@dataclass(frozen=True)
class Ramp:
    """Moves joint 0 at 1 rad/s for `duration` seconds."""

    q0: float
    duration: float

    def command(self, t):
        return np.array([self.q0 + min(t, self.duration), 2.0]), 0.05, t >= self.duration - 1e-9


class Counter:
    """Ramps three times, half a second each, counts in its memory, then finishes."""

    def __init__(self):
        self.looks = []

    def start(self):
        return Decision("wait", 0)

    def decide(self, state, memory, *, time, motion_done, senses):
        if not motion_done:
            return None
        self.looks.append((time, senses.q[0], senses.width, senses.image("picture")))
        if memory == 3:
            return Decision("end", memory, finished=True)
        return Decision(f"ramp{memory}", memory + 1, Ramp(0.5 * memory, 0.5))


@pytest.fixture
def run():
    def simulate(until):
        task = Counter()
        builder = DiagramBuilder()
        machine = builder.AddSystem(
            StateMachine(
                task,
                initial_position=[0.0, 2.0],
                initial_width=0.1,
                image_ports={"picture": AbstractValue.Make("")},
            )
        )
        for source, port in (
            (ConstantVectorSource([7.0, 8.0]), "position_measured"),
            (ConstantVectorSource([0.03, 0.0]), "hand_state"),
            (ConstantValueSource(AbstractValue.Make("a picture")), "picture"),
        ):
            builder.Connect(builder.AddSystem(source).get_output_port(), machine.GetInputPort(port))
        log = LogVectorOutput(machine.GetOutputPort("position"), builder, 0.005)
        diagram = builder.Build()
        simulator = Simulator(diagram)
        simulator.AdvanceTo(until)
        context = simulator.get_context()
        return task, machine.status(machine.GetMyContextFromRoot(context)), log.FindLog(context)

    return simulate


def test_the_command_is_the_motion_that_was_decided(run):
    _, status, log = run(2.0)
    # Three ramps of 0.5 s one after the other are one ramp to 1.5 rad, which is then held. A
    # command is the state before the update of its instant: one command period late.
    expected = np.clip(log.sample_times() - 0.005, 0.0, 1.5)
    np.testing.assert_allclose(log.data()[0], expected, atol=1e-9)
    np.testing.assert_array_equal(log.data()[1], 2.0)
    assert status.decision.finished
    assert [name for _, name in status.history] == ["wait", "ramp0", "ramp1", "ramp2", "end"]
    np.testing.assert_allclose([t for t, _ in status.history], [0, 0, 0.5, 1.0, 1.5], atol=1e-9)


def test_the_task_senses_what_is_on_the_ports(run):
    task, _, _ = run(0.6)
    assert [look[1:] for look in task.looks] == [(7.0, 0.03, "a picture")] * 2


def test_a_finished_machine_decides_no_more(run):
    task, _, _ = run(4.0)
    assert len(task.looks) == 4
