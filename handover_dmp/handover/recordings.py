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

"""Recordings to learn from and to replay: the example, or a file of the user."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.dmp import DecoupledDmp, load_model
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap import condition, HandoverTrial, read_trial, synthesize
from handover_dmp.mocap.session import read_session, RecordedSession
from handover_dmp.mocap.synthetic_session import synthesize_sessions
from handover_dmp.mocap.wrists import WristMotion
import numpy as np

EXAMPLE = ('engine_bay', 'give')
EXAMPLE_SESSION = ('engine_bay', 3)
"""Configuration and index of the synthetic session; both hands move in it."""
MAX_REST_S = 0.5
"""A recording is cut if it exceeds its handover by more than this, s."""
MIN_SAMPLES = 5
ROUNDING_S = 1e-6


def example_trials(
    seed: int = 0, direction: str = EXAMPLE[1]
) -> tuple[HandoverTrial, HandoverTrial]:
    """
    Create the handovers of the example: an assistant gives to a mechanic at an engine bay.

    Args:
        seed: seed of the synthetic data set.
        direction: `give`, or `take` if the assistant takes from the mechanic.

    Returns:
        The handover to learn from, and the one to run against: of the others, the one whose
        partner moves farthest.

    """
    example = EXAMPLE[0], direction
    trials = [t for t in synthesize(seed) if (t.configuration, t.direction) == example]
    taught, *others = trials
    return taught, max(others, key=lambda t: float(np.linalg.norm(t.partner[-1] - t.partner[0])))


def example_model(seed: int = 0, direction: str = EXAMPLE[1]) -> DecoupledDmp:
    """
    Learn the movement of the example.

    Args:
        seed: seed of the synthetic data set.
        direction: `give` or `take`.

    Returns:
        The learnt movement.

    """
    learnt: DecoupledDmp = learn_from_trials([example_trials(seed, direction)[0]])
    return learnt


def example_sessions(seed: int = 0) -> tuple[RecordedSession, RecordedSession]:
    """
    Create the sessions of the example: an assistant and a mechanic, with one tool.

    Args:
        seed: seed of the synthetic data set.

    Returns:
        A session to learn from, and another one to run against.

    """
    configuration, number = EXAMPLE_SESSION
    taught, *_, replayed = synthesize_sessions(seed, number, configurations=[configuration])
    return taught, replayed


def read_model(path: Path) -> DecoupledDmp:
    """
    Read a movement for handovers from a model file.

    Args:
        path: model file.

    Returns:
        The movement.

    Raises:
        DataError: the file cannot be used, or its primitive is not decoupled and
            three-dimensional.

    """
    model = load_model(path)
    if not isinstance(model, DecoupledDmp) or len(model.start) != 3:
        raise DataError(f'{path}: not a decoupled movement primitive of three dimensions')
    return model


def recorded_trial(
    path: str | Path, *, cutoff_hz: float, span_s: tuple[float, float] | None = None
) -> HandoverTrial:
    """
    Read a handover to replay.

    Args:
        path: CSV file or bag; empty: that of the example.
        cutoff_hz: cutoff of the zero-phase low-pass filter, Hz; 0: unfiltered.
        span_s: beginning and end of the handover in a bag, s from its first pose of the hand;
            detected if left out.

    Returns:
        The handover at 200 Hz, filtered; its source names the part that was cut from a bag.

    Raises:
        DataError: the file cannot be used, or the bag holds several handovers.

    """
    if not str(path):
        trial = example_trials()[1]
    elif Path(path).suffix.lower() != '.csv':
        trial = _trial_of_bag(Path(path), span_s)
    else:
        trial = read_trial(Path(path))
    return condition(trial, cutoff_hz=cutoff_hz) if cutoff_hz else trial


def recorded_session(path: str | Path, *, cutoff_hz: float) -> RecordedSession:
    """
    Read a session to replay.

    Args:
        path: CSV file or bag; empty: a synthetic one.
        cutoff_hz: cutoff of the zero-phase low-pass filter, Hz; 0: unfiltered.

    Returns:
        The session, filtered.

    Raises:
        DataError: the file cannot be used, or contains no exchange.

    """
    session = read_session(path) if str(path) else example_sessions()[1]
    return session.low_passed(cutoff_hz)


def _trial_of_bag(path: Path, span_s: tuple[float, float] | None) -> HandoverTrial:
    from handover_dmp.mocap.bag import describe_bag, read_bag_wrists

    wrists = read_bag_wrists(path)
    configuration, direction, number = describe_bag(path)
    source = str(path)
    if span_s is None:
        span_s = _handover_in(wrists)
    first, end = 0, len(wrists.times)
    if span_s is not None:
        edges = (span_s[0] - ROUNDING_S, span_s[1] + ROUNDING_S)
        first, end = np.searchsorted(wrists.times, edges).tolist()
        source += f', {span_s[0]:.2f} s to {span_s[1]:.2f} s'
        if end - first < MIN_SAMPLES:
            raise DataError(f'{source}: {max(end - first, 0)} samples are too few for a handover')
    return HandoverTrial(
        wrists.times[first:end] - wrists.times[first],
        wrists.partner[first:end],
        wrists.demonstrator[first:end],
        configuration=configuration,
        direction=direction or 'give',
        number=number,
        source=source,
        **{
            name: quaternions[first:end]
            for name in ('partner_orientation', 'demonstrator_orientation')
            if (quaternions := getattr(wrists, name)) is not None
        },
    )


def _handover_in(wrists: WristMotion) -> tuple[float, float] | None:
    """Find the one handover in a longer recording; None if there is nothing to cut."""
    from handover_dmp.mocap.segmentation import segment

    duration_s = float(wrists.times[-1] - wrists.times[0])
    found = segment(wrists).segments
    if len(found) > 1:
        at = ', '.join(f'{one.start_s:.2f} to {one.exchange_s:.2f} s' for one in found)
        raise DataError(
            f'{wrists.source}: {len(found)} handovers, {at}: choose one, e.g. with from:= and to:='
        )
    if found and found[0].exchange_s - found[0].start_s < duration_s - MAX_REST_S:
        return found[0].start_s, found[0].exchange_s
    return None


def scaled(trial: HandoverTrial, factor: float, centre: Array | None = None) -> HandoverTrial:
    """
    Scale a handover about the point where P2's hand ends.

    Args:
        trial: the handover.
        factor: factor on all distances; 1: unchanged.
        centre: (3,) m, another centre.

    Returns:
        The scaled handover.

    """
    centre = trial.demonstrator[-1] if centre is None else centre
    return replace(
        trial,
        partner=centre + factor * (trial.partner - centre),
        demonstrator=centre + factor * (trial.demonstrator - centre),
        way_back=trial.way_back and scaled(trial.way_back, factor, centre),
    )
