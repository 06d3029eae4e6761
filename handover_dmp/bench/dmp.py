# Copyright 2026 The handover_dmp authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The movement primitive: step, rollouts, learning, error, lag."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from math import erf, sqrt
from typing import Any

from handover_dmp.bench.measurement import Measurement, time_call
from handover_dmp.common.arrays import Array
from handover_dmp.dmp import DecoupledDmp, DmpParameters, learn
from handover_dmp.tracking.partner_model import PartnerModel
import numpy as np
from scipy.integrate import solve_ivp

SAMPLES = 301
DURATION_S = 1.5
BASIS = 50
BATCH = 1000
SPEED = 0.2  # speed of the followed hand, m/s
PEER, OLD_PEER = 'movement-primitives', 'pydmps'
MODULES = {PEER: 'movement_primitives.dmp', OLD_PEER: 'pydmps.dmp_discrete'}


def run(progress: Callable[[str], None]) -> list[Measurement]:
    """
    Measure.

    Args:
        progress: called with the name of each measurement.

    Returns:
        The figures.

    """
    times, path = _demonstration()
    model: DecoupledDmp = learn(times, path, regression='ridge', basis=BASIS)
    progress('step')
    figures = [_step(model, times, path)]
    progress('partner model')
    figures.append(_partner(model, times, path))
    progress('rollout')
    figures.append(_rollout(model, times, path))
    progress('1,000 rollouts')
    figures.append(_batch(model, times, path))
    progress('learning')
    figures.append(_learning(times, path))
    progress('error against DOP853')
    figures += _errors(times, path)
    progress('lag')
    figures.append(_lag(model, times, path))
    progress('reproduction')
    figures.append(_reproduction(model, times, path))
    return figures


def _demonstration() -> tuple[Array, Array]:
    """Return a curved reach."""
    u = np.linspace(0.0, 1.0, SAMPLES)
    share = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = np.outer(1 - share, [0.1, 0.2, 0.3]) + np.outer(share, [0.6, 0.0, 0.5])
    path[:, 2] += 0.1 * np.sin(np.pi * u) ** 2
    return u * DURATION_S, path


def _step(model: DecoupledDmp, times: Array, path: Array) -> Measurement:
    goal, still, dt = tuple(model.goal.tolist()), (0.0, 0.0, 0.0), DURATION_S / (SAMPLES - 1)

    def through() -> None:
        state, step = model.initial_state(), model.step
        for _ in range(100):
            state = step(state, goal, still, dt)

    peers: dict[str, float] = {}
    if peer := _peer(times, path):
        position, velocity = path[0], np.zeros(3)
        peers[PEER] = 1e6 * time_call(lambda: peer.step(position, velocity), calls=20)
    if old := _old_peer(path):
        peers[OLD_PEER] = 1e6 * time_call(old.step, calls=20)
    return Measurement(
        f'DMP step, 3 dimensions, {BASIS} basis functions',
        1e4 * time_call(through, rounds=101),
        'µs',
        target=3.0,
        floor=1e4 * time_call(_floor_of_step, rounds=101),
        peers=peers,
        note=_missing(),
    )


def _floor_of_step() -> None:
    """Take 100 steps of a spring and damper towards tabled goals, in plain floats."""
    table = [(0.1, 0.2, 0.3)] * 100
    x = y = z = vx = vy = vz = 0.0
    stiffness, damping, dt = 90.0, 19.0, 0.005
    state = ((x, y, z), (vx, vy, vz))
    for gx, gy, gz in table:
        (x, y, z), (vx, vy, vz) = state
        ax = stiffness * (gx - x) - damping * vx
        ay = stiffness * (gy - y) - damping * vy
        az = stiffness * (gz - z) - damping * vz
        vx += ax * dt
        vy += ay * dt
        vz += az * dt
        state = ((x + vx * dt, y + vy * dt, z + vz * dt), (vx, vy, vz))


def _partner(model: DecoupledDmp, times: Array, path: Array) -> Measurement:
    """Step the partner model and the DMP for a hand that moves as in the demonstration."""
    hands = path[-1] + 0.5 * (path[-1] - path)
    knowing = model.with_partner_path(hands[:: (SAMPLES - 1) // 100])
    seen = [tuple(hand) for hand in hands.tolist()]
    still, dt = (0.0, 0.0, 0.0), DURATION_S / (SAMPLES - 1)
    PartnerModel(knowing)  # its table is made once per model

    def through() -> None:
        expect, step, state = PartnerModel(knowing).expect, knowing.step, knowing.initial_state()
        for hand in seen:
            found = expect(hand, still, state, dt)
            state = step(state, found.goal, found.goal_velocity, dt, found.phase_rate)

    return Measurement(
        'partner model and DMP step, one period',
        1e6 / SAMPLES * time_call(through, rounds=31),
        'µs',
        target=20.0,
        note='filter, trust, expected goal, phase rate; the step at another rate each time',
    )


def _rollout(model: DecoupledDmp, times: Array, path: Array) -> Measurement:
    goals, rates = _moving_goals(times, 1)
    peers = {}
    if peer := _peer(times, path):
        peers[PEER] = 1e3 * time_call(peer.open_loop, rounds=5)
    return Measurement(
        f'rollout of {SAMPLES} samples, moving goal',
        1e3 * time_call(lambda: model.rollout(times, goals[0], rates[0]), rounds=101),
        'ms',
        target=0.3,
        peers=peers,
        note=_missing(),
    )


def _batch(model: DecoupledDmp, times: Array, path: Array) -> Measurement:
    goals, _ = _moving_goals(times, BATCH)
    peers = {}
    if peer := _peer(times, path):
        peers[PEER] = 1e3 * BATCH * time_call(peer.open_loop, rounds=3)
    copy = goals.copy()
    return Measurement(
        f'{BATCH} rollouts of {SAMPLES} samples, moving goals',
        1e3 * time_call(lambda: model.rollout_batch(times, goals), rounds=101),
        'ms',
        target=5.0,
        floor=1e3 * time_call(lambda: np.copyto(copy, goals), rounds=31),
        peers=peers,
        note='; '.join(filter(None, ('two threads; floor: copying what goes in', _missing()))),
    )


def _learning(times: Array, path: Array) -> Measurement:
    peers = {}
    if peer := _peer(times, path):
        peers[PEER] = 1e3 * time_call(lambda: peer.imitate(times, path), rounds=9)
    work = np.random.default_rng(0).standard_normal((SAMPLES, BASIS))
    return Measurement(
        f'learning from {SAMPLES} samples by ridge, {BASIS} basis functions',
        1e3 * time_call(lambda: learn(times, path, regression='ridge', basis=BASIS), rounds=31),
        'ms',
        target=1.5,
        floor=1e3 * time_call(lambda: np.linalg.lstsq(work, path, rcond=None), rounds=31),
        peers=peers,
        note='floor: least squares alone' + (f'; {_missing()}' if _missing() else ''),
    )


def _errors(times: Array, path: Array) -> list[Measurement]:
    figures = []
    for formulation in ('stiff', 'printed'):
        parameters = DmpParameters(formulation=formulation)
        model: DecoupledDmp = learn(times, path, parameters, regression='ridge', basis=BASIS)
        for name, place, rate in (
            ('static', lambda t: _GOAL, lambda t: np.zeros(3)),
            ('moving', _wander, _wander_rate),
        ):
            goals = np.array([place(t) for t in times])
            motion = model.rollout(times, goals, start=path[0])
            error = np.abs(motion.positions - _exact(model, times, place, rate)).max()
            figures.append(
                Measurement(
                    f'error against DOP853, {name} goal, {formulation}',
                    1e3 * float(error),
                    'mm',
                    target=0.02,
                )
            )
    return figures


_GOAL = np.array([0.65, 0.05, 0.45])


def _wander(t: float) -> Array:
    place: Array = _GOAL + np.array([0.1, -0.05, 0.08]) * np.sin(2.0 * t)
    return place


def _wander_rate(t: float) -> Array:
    rate: Array = 2.0 * np.array([0.1, -0.05, 0.08]) * np.cos(2.0 * t)
    return rate


def _exact(
    model: DecoupledDmp,
    times: Array,
    goal: Callable[[float], Array],
    goal_velocity: Callable[[float], Array],
) -> Array:
    """Solve (8) as printed in the paper."""
    parameters, tau = model.parameters, model.duration_s
    k, d, k_s = parameters.stiffness, parameters.effective_damping, parameters.shape_stiffness
    k_v = parameters.effective_goal_velocity_gain(tau)
    x0 = model.start

    def derivative(t: float, y: Array) -> Array:
        x, v = y[:3], y[3:]
        phase = np.exp(-parameters.alpha * t / tau)
        shape = model.basis.activations(np.array([phase]))[0] @ model.weights
        w = 0.5 * (1 + erf((t / tau - parameters.mu) / (parameters.sigma * sqrt(2.0))))
        force = (1 - w) * k_s * (shape + x0 - x) + w * (k * (goal(t) - x) + k_v * goal_velocity(t))
        return np.concatenate([v, force - d * v]) / tau

    solution = solve_ivp(
        derivative,
        (times[0], times[-1]),
        np.concatenate([x0, np.zeros(3)]),
        'DOP853',
        times,
        rtol=1e-12,
        atol=1e-12,
    )
    positions: Array = solution.y[:3].T
    return positions


def _lag(model: DecoupledDmp, times: Array, path: Array) -> Measurement:
    """Follow a hand that keeps moving at constant speed, long after τ."""
    long = np.arange(0.0, 4.0 * DURATION_S, 0.005)
    goals = model.goal + np.outer(long, [SPEED, 0.0, 0.0])
    behind = np.abs(model.rollout(long, goals).positions - goals)[-1].max()
    peers = {}
    if peer := _peer(times, path):
        # its goals have no velocity, so they are moved before each step
        position, velocity = path[0].copy(), np.zeros(3)
        for goal in goals:
            peer.configure(start_y=path[0], goal_y=goal)
            position, velocity = peer.step(position, velocity)
        peers[PEER] = 1e3 * float(np.abs(position - goals[-1]).max())
    return Measurement(
        f'lag behind a hand at {SPEED} m/s',
        1e3 * float(behind),
        'mm',
        target=0.5,
        peers=peers,
        note=_missing(),
    )


def _reproduction(model: DecoupledDmp, times: Array, path: Array) -> Measurement:
    motion = model.rollout(times, model.goal, start=path[0], velocity=model.start_velocity)
    peers = {}
    if peer := _peer(times, path):
        _, reproduced = peer.open_loop()
        count = min(len(reproduced), len(path))
        peers[PEER] = 1e3 * float(np.abs(reproduced[:count] - path[:count]).max())
    return Measurement(
        f'reproduction of a demonstration, {BASIS} basis functions',
        1e3 * float(np.abs(motion.positions - path).max()),
        'mm',
        target=0.1,
        peers=peers,
        note=_missing(),
    )


def _moving_goals(times: Array, count: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(0)
    rates = np.broadcast_to(
        0.2 * rng.standard_normal((count, 1, 3)), (count, times.size, 3)
    ).copy()
    goals = _GOAL + 0.1 * rng.standard_normal((count, 1, 3)) + rates * times[:, None]
    return goals, rates


def _peer(times: Array, path: Array) -> Any:
    """Learn with movement-primitives; None if it is not installed."""
    if (module := _imported(PEER)) is None:
        return None
    peer = module.DMP(3, execution_time=DURATION_S, dt=float(times[1]), n_weights_per_dim=BASIS)
    peer.imitate(times, path)
    peer.configure(start_y=path[0], goal_y=path[-1])
    return peer


def _old_peer(path: Array) -> Any:
    """Learn with pydmps; None if it is not installed."""
    if (module := _imported(OLD_PEER)) is None:
        return None
    peer = module.DMPs_discrete(n_dmps=3, n_bfs=BASIS, dt=1.0 / (SAMPLES - 1))
    peer.imitate_path(path.T.copy())
    peer.reset_state()
    return peer


def _imported(peer: str) -> Any:
    """Import a peer; None if it, or what it needs, is not installed."""
    with suppress(ImportError):
        return import_module(MODULES[peer])
    return None


def _missing() -> str:
    absent = [peer for peer in MODULES if _imported(peer) is None]
    return f'not installed: {", ".join(absent)}' if absent else ''
