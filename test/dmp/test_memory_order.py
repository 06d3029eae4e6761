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

"""Equal arrays, equal bits: nothing of how a model came to be is in how it moves."""

from __future__ import annotations

from collections.abc import Callable
import copy
from dataclasses import replace
from itertools import product
from pathlib import Path
import pickle
from typing import Any

from handover_dmp.dmp import ClassicalDmp, learn, load_model, relearn, save_model
from handover_dmp.dmp.basis import Basis
from handover_dmp.dmp.learning import learn_jointly, learn_mean
from handover_dmp.dmp.posterior import WeightPosterior
from handover_dmp.dmp.primitive import Primitive
from handover_dmp.evaluation.cases import Case
from handover_dmp.evaluation.rollouts import learn_from_case, Learning
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap import HandoverTrial
import numpy as np
import pytest

Way = Callable[[Any, Any, Path], Primitive]

TIMES = np.linspace(0.0, 2.0, 100)
ARRAYS = ('start', 'goal', 'goal_offset', 'start_velocity', 'weights')


def two(times: Any, path: Any) -> list[tuple[Any, Any]]:
    return [(times, path), (1.2 * times, path + 0.01 * np.sin(times)[:, None])]


def trials(times: Any, path: Any) -> list[HandoverTrial]:
    return [
        HandoverTrial(stamps, points[::-1] + 0.1, points, 'lab', 'give', number)
        for number, (stamps, points) in enumerate(two(times, path), 1)
    ]


def loaded(model: Primitive, folder: Path) -> Primitive:
    save_model(model, folder / 'model.json')
    return load_model(folder / 'model.json')


LEARNT: dict[str, Way] = {
    'rvm': lambda t, x, _: learn(t, x, basis=20),
    'ridge': lambda t, x, _: learn(t, x, regression='ridge', basis=20),
    'classical, rvm': lambda t, x, _: learn(t, x, basis=20, primitive=ClassicalDmp),
    'classical, ridge': lambda t, x, _: learn(
        t, x, regression='ridge', basis=20, primitive=ClassicalDmp
    ),
    'one dimension': lambda t, x, _: learn(t, x[:, :1], regression='ridge', basis=20),
    'mean': lambda t, x, _: learn_mean(two(t, x), regression='ridge'),
    'jointly': lambda t, x, _: learn_jointly(two(t, x), regression='ridge'),
    'jointly, rvm': lambda t, x, _: learn_jointly(two(t, x)),
    'of trials': lambda t, x, _: learn_from_trials(trials(t, x)),
    'of trials, jointly': lambda t, x, _: learn_from_trials(
        trials(t, x), regression='ridge', jointly=True
    ),
    'tuned': lambda t, x, _: learn_from_case(
        Case('lab', 'give', tuple(trials(t, x))), [0, 1], 'decoupled', Learning(duration_scale=0.9)
    )[0],
}
MADE_OF_ONE: dict[str, Callable[[Primitive, Path], Primitive]] = {
    'relearnt': lambda model, _: relearn(model, stiffness=150.0, mu=0.7),
    'with other parameters': lambda model, _: replace(
        model, parameters=replace(model.parameters, formulation='printed')
    ),
    'with another duration': lambda model, _: model.with_duration(1.1),
    'with an offset': lambda model, _: model.with_goal_offset(np.array([0.3, 0.2, 0.1])[::-1]),
    'with other weights': lambda model, _: model.with_weights(
        np.asfortranarray(model.weights), model.covariance
    ),
    'replaced': lambda model, _: replace(model, start=model.start[::-1]),
    'loaded': loaded,
    'pickled': lambda model, _: pickle.loads(pickle.dumps(model)),
    'copied': lambda model, _: copy.copy(model),
    'copied deeply': lambda model, _: copy.deepcopy(model),
}
WAYS = {
    **LEARNT,
    **{
        f'{learnt}, {made}': lambda t, x, folder, one=one, then=then: then(
            one(t, x, folder), folder
        )
        for (learnt, one), (made, then) in product(
            [item for item in LEARNT.items() if item[0] in ('rvm', 'ridge')],
            MADE_OF_ONE.items(),
        )
    },
}


def typed_in(model: Primitive) -> Primitive:
    """Make a model of the same numbers, each of them written down and read again."""
    covariance = model.covariance and tuple(
        WeightPosterior(np.array(each.active.tolist(), int), np.array(each.matrix.tolist()))
        for each in model.covariance
    )
    return type(model)(
        model.parameters,
        model.duration_s,
        basis=Basis(
            np.array(model.basis.centres.tolist()), np.array(model.basis.sharpness.tolist())
        ),
        covariance=covariance,
        **{name: np.array(getattr(model, name).tolist()) for name in ARRAYS},
    )


def motion(model: Primitive) -> bytes:
    """Give the bits of where a model moves, and how sure it is."""
    goals = model.goal + np.outer(np.sin(TIMES), np.full(model.dimensions, 0.1))
    rollout = model.rollout(TIMES, goals, deviation=model.covariance is not None)
    batch = model.rollout_batch(TIMES, np.stack([goals, goals + 0.1]))
    told = [rollout.positions, rollout.velocities, *batch]
    if rollout.deviation is not None:
        told.append(rollout.deviation)
    return b''.join(np.asarray(each).tobytes() for each in told)


def stepped(model: Primitive) -> Any:
    state = model.initial_state()
    for _ in range(50):
        state = model.step(state, model.goal.tolist(), [0.1] * model.dimensions, 0.02)
    return state


def arrays(model: Primitive) -> list[np.ndarray]:
    return [
        *(getattr(model, name) for name in ARRAYS),
        model.basis.centres,
        model.basis.sharpness,
        *(array for each in model.covariance or () for array in (each.active, each.matrix)),
    ]


@pytest.mark.parametrize('way', WAYS)
def test_however_a_model_came_to_be_equal_numbers_move_alike(
    way: str, reach: Any, tmp_path: Path
) -> None:
    model = WAYS[way](*reach, tmp_path)
    for array in arrays(model):
        assert array.flags.c_contiguous
        assert not array.flags.writeable
        assert array.strides == np.empty(array.shape, array.dtype).strides
    assert motion(model) == motion(typed_in(model))


LAYOUTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    'column by column': np.asfortranarray,
    'turned round': lambda array: np.flip(np.flip(array).copy()),
    'every second column': lambda array: np.repeat(array, 2, axis=-1)[..., ::2],
    'every second row': lambda array: np.repeat(array, 2, axis=0)[::2],
    'big-endian': lambda array: array.astype(array.dtype.newbyteorder('>')),
}


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('regression', ['rvm', 'ridge'])
def test_however_the_arrays_lay_equal_numbers_move_alike(
    layout: str, regression: str, reach: Any
) -> None:
    laid = LAYOUTS[layout]
    times, path = reach
    model = learn(times, path, regression=regression, basis=20)
    other = replace(
        model,
        basis=Basis(laid(model.basis.centres), laid(model.basis.sharpness)),
        covariance=model.covariance
        and tuple(WeightPosterior(laid(p.active), laid(p.matrix)) for p in model.covariance),
        **{name: laid(getattr(model, name)) for name in ARRAYS},
    )
    assert motion(other) == motion(model)
    assert stepped(other) == stepped(model)
    again = learn(laid(times), laid(path), regression=regression, basis=20)
    assert motion(again) == motion(model), 'nor does it matter how the recording lay'


def test_tables_are_not_pickled(reach: Any) -> None:
    model = learn(*reach, basis=20)
    small = len(pickle.dumps(model))
    model.rollout(TIMES, model.goal)
    assert len(pickle.dumps(model)) == small < 50_000
