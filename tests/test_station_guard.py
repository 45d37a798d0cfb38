"""The guard: limits that hold whatever is commanded, and commands that pass untouched."""

import dataclasses as dc
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from prehensile.errors import InputError
from prehensile.station.guard import (
    GuardLimits,
    GuardState,
    GuardStatus,
    brake_speed,
    guard_step,
)
from prehensile.station.guard_system import JointGuard

LIMITS = GuardLimits(
    position_lower=(-1.0, -0.2),
    position_upper=(2.0, 0.3),
    velocity=(1.5, 0.7),
    acceleration=(10.0, 25.0),
    effort_lower=(-5.0, -1.0),
    effort_upper=(5.0, 2.0),
    effort_default=(0.0, 0.5),
    jump=0.1,
)
PERIOD = 0.005
TOLERANCE = 1e-9


def at_rest(*position: float, status: GuardStatus = GuardStatus.UNCONNECTED) -> GuardState:
    n = len(position)
    return GuardState(list(position), [0.0] * n, (0.0,) * n, list(position), status)


def following(*position: float) -> GuardState:
    return at_rest(*position, status=GuardStatus.OK)


def play(state, commands, *, limits=LIMITS, period=PERIOD):
    """Positions and statuses that come out, the first position being the start."""
    positions, statuses = [list(state.position)], []
    for command in commands:
        state = guard_step(state, command, None, limits, period)
        positions.append(list(state.position))
        statuses.append(state.status)
    return np.array(positions), statuses


def check_limits(positions: np.ndarray, limits: GuardLimits, period: float) -> None:
    """Differences the positions: the only thing that a joint sees of the guard."""
    velocity = np.diff(positions, axis=0, prepend=positions[:1]) / period
    acceleration = np.diff(velocity, axis=0, prepend=np.zeros_like(velocity[:1])) / period
    assert np.all(positions >= np.array(limits.position_lower) - TOLERANCE)
    assert np.all(positions <= np.array(limits.position_upper) + TOLERANCE)
    assert np.all(np.abs(velocity) <= np.array(limits.velocity) + TOLERANCE)
    assert np.all(np.abs(acceleration) <= np.array(limits.acceleration) + TOLERANCE)


anything = st.one_of(
    st.floats(),
    st.floats(-3, 3),
    st.sampled_from([math.nan, math.inf, -math.inf, 2.0, -1.0, 1e300, 0.3, 5e-324]),
)


@settings(max_examples=150, deadline=None)
@given(
    start=st.tuples(st.floats(-1.0, 2.0), st.floats(-0.2, 0.3)),
    commands=st.lists(
        st.tuples(
            st.one_of(st.none(), st.tuples(anything, anything)),
            st.one_of(st.none(), st.tuples(anything, anything)),
            st.booleans(),
            st.integers(1, 60),
        ),
        min_size=1,
        max_size=12,
    ),
    period=st.sampled_from([0.002, 0.005, 0.05]),
    jump=st.sampled_from([0.1, math.inf]),
)
@example(
    start=(2.0, 0.3),
    commands=[((1.95, 0.25), None, True, 1), ((9.0, 9.0), None, True, 60)],
    period=0.005,
    jump=math.inf,
)
def test_no_sequence_of_commands_breaks_a_limit(start, commands, period, jump):
    limits = dc.replace(LIMITS, jump=jump)
    state = at_rest(*start)
    positions = [start]
    for command, effort, fresh, times in commands:
        for _ in range(times):
            state = guard_step(state, command, effort, limits, period, fresh=fresh)
            positions.append(tuple(state.position))
            assert np.all(np.array(state.effort) >= limits.effort_lower)
            assert np.all(np.array(state.effort) <= limits.effort_upper)
    check_limits(np.array(positions), limits, period)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0.01, 3.0))
def test_noise_does_not_break_a_limit(seed, scale):
    commands = np.random.default_rng(seed).normal(0.0, scale, (300, 2))
    positions, _ = play(following(0.0, 0.0), commands.tolist())
    check_limits(positions, LIMITS, PERIOD)


@settings(max_examples=50, deadline=None)
@given(
    amplitude=st.floats(0.01, 0.19),
    rate=st.floats(0.1, 3.0),
    offset=st.floats(-0.005, 0.1),
)
def test_commands_within_the_limits_pass_bit_for_bit(amplitude, rate, offset):
    # From rest along a cosine: velocity and acceleration at most 0.57 and 1.7.
    t = PERIOD * np.arange(400)
    wave = offset + amplitude * (1 - np.cos(rate * t)) / 2
    commands = np.stack([wave, wave], axis=1).tolist()
    positions, statuses = play(following(offset, offset), commands)
    assert positions[1:].tolist() == commands
    assert set(statuses) == {GuardStatus.OK}


def test_commands_at_the_limits_exactly_pass():
    # Full acceleration to full speed, then full deceleration to the very end of the range.
    a, v, h = 10.0, 1.5, PERIOD
    ramp = np.minimum(a * h * np.arange(1, 200), v)
    speeds = np.concatenate([ramp, np.full(100, v), np.flip(ramp)[-30:]])
    q = 2.0 - np.sum(speeds) * h + np.cumsum(speeds) * h
    commands = [[min(x, 2.0), 0.0] for x in q]
    positions, statuses = play(following(float(q[0] - speeds[0] * h), 0.0), commands)
    assert np.max(np.abs(positions[1:, 0] - q)) < 1e-12
    assert (
        statuses.count(GuardStatus.OK) >= len(statuses) - 31
    )  # braking may differ in the last bit


def test_a_step_is_approached_without_overshoot_in_the_least_time():
    positions, statuses = play(following(0.0, 0.0), [[1.0, 0.0]] * 400)
    q = positions[:, 0]
    assert np.all(np.diff(q) >= 0)
    assert q[-1] == 1.0
    assert statuses[-1] is GuardStatus.OK
    assert statuses[0] is GuardStatus.LIMITED
    # Bang, coast, bang: distance over speed, plus once the time to full speed.
    least = 1.0 / 1.5 + 1.5 / 10.0
    taken = PERIOD * np.argmax(q >= 1.0 - 1e-12)
    assert least - PERIOD <= taken <= least + 3 * PERIOD


def test_lag_behind_a_moving_command_is_made_up():
    # The command jumps ahead by 0.3 and moves on at 0.8 rad/s.
    commands = [[0.3 + 0.8 * PERIOD * k, 0.0] for k in range(300)]
    positions, statuses = play(following(0.0, 0.0), commands)
    assert statuses[-1] is GuardStatus.OK
    assert positions[-1, 0] == commands[-1][0]
    assert np.all(positions[1:, 0] <= np.array(commands)[:, 0] + 1e-12)
    check_limits(positions, LIMITS, PERIOD)


@given(
    distance=st.floats(0.0, 10.0), acceleration=st.floats(0.1, 100.0), period=st.floats(1e-3, 0.1)
)
def test_brake_speed_stops_in_time_and_no_slower_than_it_must(distance, acceleration, period):
    def stopping_distance(v: float) -> float:
        total = v * period
        while (v := v - acceleration * period) > 0:
            total += v * period
        return total

    v = brake_speed(distance, acceleration, period)
    assert stopping_distance(v) == pytest.approx(distance, rel=1e-9, abs=1e-12)


def test_a_first_command_far_away_is_refused_until_it_comes_near():
    state = guard_step(at_rest(0.0, 0.0), [0.5, 0.0], None, LIMITS, PERIOD)
    assert state.status is GuardStatus.JUMP
    assert state.position == [0.0, 0.0]
    state = guard_step(state, [0.09, 0.0], None, LIMITS, PERIOD)
    assert state.status is GuardStatus.LIMITED
    assert state.position[0] > 0.0
    # Once it follows, the same distance is approached within the limits.
    state = guard_step(state, [0.5, 0.0], None, LIMITS, PERIOD)
    assert state.status is GuardStatus.LIMITED


@pytest.mark.parametrize(
    ("command", "fresh", "status"),
    [
        ([math.nan, 0.0], True, GuardStatus.NOT_FINITE),
        ([0.0, math.inf], True, GuardStatus.NOT_FINITE),
        ([0.5, 0.0], False, GuardStatus.STALE),
        (None, True, GuardStatus.UNCONNECTED),
    ],
)
def test_faults_brake_and_hold(command, fresh, status):
    state = following(0.0, 0.0)
    for k in range(100):
        state = guard_step(state, [0.005 * k, 0.0], None, LIMITS, PERIOD)
    speed, position = state.velocity[0], state.position[0]
    assert speed > 0.9
    positions = [list(state.position)]
    for _ in range(60):
        state = guard_step(state, command, None, LIMITS, PERIOD, fresh=fresh)
        positions.append(list(state.position))
        assert state.status is status
    q = np.array(positions)[:, 0]
    assert q[-1] == q[-2]
    assert q[-1] - position == pytest.approx(speed**2 / (2 * 10.0), abs=speed * PERIOD)
    assert np.all(np.diff(np.diff(q)) <= 1e-12)


def test_one_lost_sample_interrupts_for_one_sample_only():
    commands = [[0.001 * k, 0.0] for k in range(50)]
    commands[20] = [math.nan, 0.0]
    positions, statuses = play(following(0.0, 0.0), commands)
    assert statuses[20] is GuardStatus.NOT_FINITE
    assert statuses[30:] == [GuardStatus.OK] * 20
    assert positions[1:][30:].tolist() == commands[30:]


def test_a_joint_outside_of_its_range_comes_back_and_no_further_out():
    for command, end in ((3.0, 2.0), (1.5, 1.5), (None, 2.05)):
        commands = [None if command is None else [command, 0.0]] * 400
        positions, _ = play(following(2.05, 0.0), commands)
        assert np.all(np.diff(positions[:, 0]) <= 0)
        assert positions[-1, 0] == end


def test_efforts_are_clipped_and_default_in_a_fault():
    state = guard_step(following(0.0, 0.0), [0.0, 0.0], [9.0, -9.0], LIMITS, PERIOD)
    assert list(state.effort) == [5.0, -1.0]
    assert state.status is GuardStatus.LIMITED
    state = guard_step(state, [0.0, 0.0], [1.0, 1.0], LIMITS, PERIOD)
    assert list(state.effort) == [1.0, 1.0]
    assert state.status is GuardStatus.OK
    for effort, fresh in (([math.nan, 1.0], True), ([1.0, 1.0], False)):
        faulty = guard_step(state, [0.0, 0.0], effort, LIMITS, PERIOD, fresh=fresh)
        assert list(faulty.effort) == [0.0, 0.5]


def test_efforts_alone_can_be_commanded():
    state = guard_step(at_rest(0.0, 0.0), None, [1.0, 1.0], LIMITS, PERIOD)
    assert list(state.effort) == [1.0, 1.0]
    assert state.status is GuardStatus.OK
    assert state.position == [0.0, 0.0]


def test_limits_are_checked():
    with pytest.raises(InputError) as error:
        GuardLimits((0.0,), (-1.0,), (0.0,), (math.inf,), (0.0,), (0.0, 1.0), (0.0,), jump=-1.0)
    assert "limits.effort_upper" in str(error.value)
    with pytest.raises(InputError) as error:
        GuardLimits((0.0,), (-1.0,), (0.0,), (math.inf,), (0.0,), (0.0,), (0.0,), jump=-1.0)
    keys = {finding.key.removeprefix("limits.") for finding in error.value.findings}
    assert keys == {"position_lower", "velocity", "acceleration", "jump"}


class TestSystem:
    """The guard as a Drake system."""

    def make(self, command=None, stamp=None, measured=(0.0, 0.0)):
        builder = DiagramBuilder()
        guard = builder.AddSystem(JointGuard())
        guard.add("arm", LIMITS, period=PERIOD, timeout=0.1, measured_size=4)
        source = builder.AddSystem(ConstantVectorSource([*measured, 9.0, 9.0]))
        builder.Connect(source.get_output_port(), guard.GetInputPort("arm.measured"))
        for port, system in (("arm.position", command), ("arm.command_time", stamp)):
            if system is not None:
                builder.AddSystem(system)
                builder.Connect(system.get_output_port(), guard.GetInputPort(port))
        for name in ("position", "status", "effort"):
            builder.ExportOutput(guard.GetOutputPort(f"arm.{name}"), name)
        simulator = Simulator(builder.Build())
        return (
            simulator,
            lambda name: simulator.get_system().GetOutputPort(name).Eval(simulator.get_context()),
        )

    def test_unconnected_holds_the_measured_position(self):
        simulator, read = self.make(measured=(0.3, -0.1))
        for until in (0.0, 0.004, 0.5):
            simulator.AdvanceTo(until)
            assert read("position").tolist() == [0.3, -0.1]
            assert read("status") == GuardStatus.UNCONNECTED
            assert read("effort").tolist() == [0.0, 0.5]

    def test_a_constant_command_is_settled_and_stays(self):
        simulator, read = self.make(ConstantVectorSource([0.05, 0.0]))
        simulator.AdvanceTo(0.5)
        assert read("position").tolist() == [0.05, 0.0]
        assert read("status") == GuardStatus.OK
        simulator.AdvanceTo(1.0)
        assert read("position").tolist() == [0.05, 0.0]

    def test_a_trajectory_passes_with_one_sample_of_delay(self):
        times = np.array([0.0, 1.0, 2.0])
        q = np.array([[0.0, 0.4, 0.0], [0.0, 0.1, -0.1]])
        trajectory = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
            times, q, np.zeros((2, 1)), np.zeros((2, 1))
        )
        simulator, read = self.make(TrajectorySource(trajectory))
        for k in range(1, 40):
            simulator.AdvanceTo(0.05 * k + 0.001)
            # Sampled at the last multiple of the period.
            assert read("position") == pytest.approx(trajectory.value(0.05 * k).ravel(), abs=1e-12)
        assert read("status") == GuardStatus.OK

    def test_a_stale_command_is_not_followed(self):
        simulator, read = self.make(ConstantVectorSource([0.05, 0.0]), ConstantVectorSource([0.2]))
        simulator.AdvanceTo(0.299)
        assert read("status") == GuardStatus.OK
        simulator.AdvanceTo(0.311)
        assert read("status") == GuardStatus.STALE
        assert read("position").tolist() == [0.05, 0.0]

    def test_a_command_given_later_ends_the_wait(self):
        simulator, read = self.make()
        simulator.AdvanceTo(0.1)
        guard = next(iter(simulator.get_system().GetSystems()))
        guard.GetInputPort("arm.position").FixValue(
            guard.GetMyMutableContextFromRoot(simulator.get_mutable_context()), [0.0, 0.0]
        )
        simulator.AdvanceTo(0.2)
        assert read("status") == GuardStatus.OK
