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

"""Reader of bags: the wrists of both partners from topics of poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
import json
from pathlib import Path
import re
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.body_path import BodyPath, make_body_path
from handover_dmp.mocap.clock import clock_step, jumps_back, parts_of, STEP_NS
from handover_dmp.mocap.filtering import interpolate
from handover_dmp.mocap.markers import name_list
from handover_dmp.mocap.message_bodies import bodies, Body
from handover_dmp.mocap.orientation import orientation_at, turn_orientation_up
from handover_dmp.mocap.trial import describe, DIRECTIONS
from handover_dmp.mocap.units import known_unit, METRES
from handover_dmp.mocap.up_axis import doubts, turn_up
from handover_dmp.mocap.wrists import AS_TOLD, find_gaps, Known, MAX_HIDDEN_S, WristMotion
from handover_dmp.topics import DEMONSTRATOR_POSE, HAND_POSE, INFO
import numpy as np
from numpy.typing import NDArray

PARTNER_TOPIC = HAND_POSE.name
DEMONSTRATOR_TOPIC = DEMONSTRATOR_POSE.name
BY_REP_103 = 'by REP 103'
CLOCKS = ('stamp', 'log')
_MIN_POSES = 4
_MAX_POSES = 2_000_000
# Poses with the same stamp that are farther apart than this belong to two bodies.
_SAME_PLACE_M = 0.02
# Largest usual difference of the transport delays of two trackers.
_SAME_DELAY_S = 0.02


def read_bag_wrists(
    path: str | Path,
    partner: str = PARTNER_TOPIC,
    demonstrator: str = DEMONSTRATOR_TOPIC,
    *,
    part: int | None = None,
    clock: str = 'stamp',
    unit: str | None = None,
    up: str | None = None,
) -> WristMotion:
    """
    Read the wrists of both partners from a bag.

    Topics may have any message with a point, pose or transform, or with a list of them. Times are
    the stamps of the messages (times of recording if the stamps are zero), counted from the first;
    P2 is interpolated at the times of P1.

    Args:
        path: a rosbag2 folder or one of its files.
        partner: topic of P1's wrist; `topic:name` or `topic:number` if it has several bodies.
        demonstrator: the same for P2. If neither is given, the bag may be of a graph in any
            namespace.
        part: number of the part, from 1, of a recording whose clock was set back.
        clock: `stamp` or `log`: use the stamps or the times of recording.
        unit: unit of length; default: metres, as in ROS.
        up: axis that points up; default: z, as in ROS.

    Returns:
        Both wrists, for the time in which their topics overlap, in metres; with orientations if
        the messages have them, unless these are (0, 0, 0, 1) throughout.

    Raises:
        DataError: the bag or a topic is missing, its poses are invalid or in two frames, no body
            of several or no part of several is chosen.

    """
    path = Path(path)
    if (partner, demonstrator) == (PARTNER_TOPIC, DEMONSTRATOR_TOPIC):
        from handover_dmp.recording import recorded_namespace

        space = recorded_namespace(path, (HAND_POSE, DEMONSTRATOR_POSE))
        partner, demonstrator = HAND_POSE.within(space), DEMONSTRATOR_POSE.within(space)
    streams = [_Stream(path, partner), _Stream(path, demonstrator)]
    _fill(path, streams)
    chosen = [stream.poses(clock) for stream in streams]
    if chosen[0].label == chosen[1].label:
        raise DataError(f'{path}: P1 and P2 are both {chosen[0].label}; choose two bodies')
    if chosen[0].frame != chosen[1].frame:
        first, second = chosen
        raise DataError(
            f'{path}: {first.label} is in frame {first.frame!r}, '
            f'{second.label} in {second.frame!r}'
        )
    chosen = _part(path, chosen, part)
    if clock == 'stamp':
        _check_clocks(path, chosen)
    found, axis = Known('m', BY_REP_103), Known('z', BY_REP_103)
    if unit is not None:
        found = Known(known_unit(unit, path.name), AS_TOLD)
    if up is not None:
        axis = Known(up, AS_TOLD)
    scale = METRES[found.value]
    zero_ns = int(min(poses.times_ns.min() for poses in chosen))
    series = [_series(poses, zero_ns) for poses in chosen]
    (partner_times, first), (other_times, second) = (
        (times[seen], scale * places[seen]) for times, places, seen in series
    )
    if min(len(partner_times), len(other_times)) < _MIN_POSES:
        short = chosen[0] if len(partner_times) < _MIN_POSES else chosen[1]
        raise DataError(
            f'{path}: {min(len(partner_times), len(other_times))} poses on {short.label}'
        )
    inside = (partner_times >= other_times[0]) & (partner_times <= other_times[-1])
    # P2 is unknown between two poses that are far apart in time.
    after = np.clip(np.searchsorted(other_times, partner_times), 1, len(other_times) - 1)
    inside &= other_times[after] - other_times[after - 1] <= MAX_HIDDEN_S
    times = partner_times[inside]
    if len(times) == 0:
        raise DataError(
            f'{path}: {chosen[0].label} and {chosen[1].label} do not overlap in time; '
            'if two clocks stamped them, --clock log uses the times of recording'
        )
    turns = [turn_orientation_up(_turns(poses, zero_ns, times), axis.value) for poses in chosen]
    start = float(partner_times[0])
    gaps = [
        gap._replace(start_s=gap.start_s - start, end_s=gap.end_s - start)
        for who, (all_times, _, seen) in zip(('P1', 'P2'), series, strict=True)
        for gap in find_gaps(all_times, seen, who)
    ]
    return WristMotion(
        times - start,
        turn_up(first[inside], axis.value),
        turn_up(interpolate(other_times, second)(times), axis.value),
        source=path.name,
        unit=found,
        up=axis,
        gaps=tuple(gaps),
        remarks=(*_remarks(chosen, clock), *(() if up else doubts((first, second), axis.value))),
        partner_orientation=turns[0],
        demonstrator_orientation=turns[1],
    ).checked()


def read_body_paths(
    path: str | Path, asked: Sequence[str], *, part: int | None = None, clock: str = 'stamp'
) -> list[BodyPath]:
    """
    Read the paths of bodies from a bag, each in the frame that its messages name.

    Args:
        path: a rosbag2 folder or one of its files.
        asked: topic of each body; `topic:name` or `topic:number` if it has several bodies.
        part: number of the part, from 1, of a recording whose clock was set back.
        clock: `stamp` or `log`: use the stamps or the times of recording.

    Returns:
        Their paths, on one clock that begins with the first pose.

    Raises:
        DataError: the bag or a topic is missing, its poses are invalid, no body of several or no
            part of several is chosen.

    """
    path = Path(path)
    streams = [_Stream(path, topic) for topic in asked]
    _fill(path, streams)
    chosen = _part(path, [stream.poses(clock) for stream in streams], part)
    zero_ns = int(min(poses.times_ns.min() for poses in chosen))
    return [
        make_body_path(
            poses.label,
            poses.frame,
            np.asarray((poses.times_ns - zero_ns) * 1e-9, dtype=np.float64),
            poses.positions,
            poses.quaternions,
            float(np.median(poses.delays_ns)) * 1e-9
            if len(poses.delays_ns) and clock == 'stamp'
            else 0.0,
        )
        for poses in chosen
    ]


def describe_bag(path: str | Path) -> tuple[str, str | None, int]:
    """
    Find out what a bag records.

    Args:
        path: a rosbag2 folder, one of its files or the folder of a run.

    Returns:
        Configuration, direction and number: from the bag's custom data, otherwise from the
        recorded run, otherwise from its name. The direction is None if it is unknown.

    Raises:
        DataError: the bag is missing or damaged.

    """
    # Not at the top: mocap files are read without the libraries that bags need.
    from handover_dmp.recording.bag_reader import bag_custom_data

    told = bag_custom_data(path)
    if 'exchange' not in told:
        told = _run_info(path)
    configuration, direction, number = describe(Path(path))
    if told.get('exchange') in DIRECTIONS:
        direction = told['exchange']
    if re.fullmatch('[0-9]{1,9}', told.get('trial', ''), re.ASCII):
        number = int(told['trial'])
    return told.get('configuration') or configuration, direction, number


def _run_info(path: str | Path) -> dict[str, str]:
    """Return what a run replayed, with the keys of a trial's bag."""
    from handover_dmp.recording import read_bag, recorded_namespace

    for _, message, _ in read_bag(path, [INFO.within(recorded_namespace(path, [INFO]))]):
        with suppress(AttributeError, RecursionError, TypeError, ValueError):
            info = json.loads(message.data)
            told = {key: str(info.get(key, '')) for key in ('configuration', 'exchange')}
            return told | {'trial': str(info.get('number', ''))}
    return {}


@dataclass(frozen=True, eq=False)
class _Poses:
    """
    The poses of one body, in the order of recording.

    Attributes:
        label: topic and body, for messages.
        frame: frame of the poses.
        times_ns: (n,) by the chosen clock.
        delays_ns: (n,) from stamp to recording; empty without stamps.
        logs_ns: (n,) times of recording.
        positions: (n, 3) m, NaN if the body was not seen.
        quaternions: (n, 4) x, y, z, w, NaN if there are none.
        unstamped: number of further poses without a stamp, if others have one.

    """

    label: str
    frame: str
    times_ns: NDArray[np.int64]
    delays_ns: NDArray[np.int64]
    logs_ns: NDArray[np.int64]
    positions: Array
    quaternions: Array
    unstamped: int

    def cut(self, part: slice) -> _Poses:
        return _Poses(
            self.label, self.frame, self.times_ns[part], self.delays_ns[part],
            self.logs_ns[part], self.positions[part], self.quaternions[part], self.unstamped,
        )  # fmt: skip


@dataclass(eq=False)
class _Stream:
    """
    A requested body, and all bodies of its topic.

    Attributes:
        path: path of the bag.
        asked: topic, or topic and body.
        found: by name or number of the body, its poses, each with the time of recording.
        counts: numbers of bodies in the messages.

    """

    path: Path
    asked: str
    found: dict[str, list[tuple[int, Body]]] = field(default_factory=dict)
    counts: set[int] = field(default_factory=set)

    @property
    def topic(self) -> str:
        return self.asked.partition(':')[0]

    def take(self, found: Sequence[Body], log_ns: int) -> None:
        self.counts.add(len(found))
        for place, body in enumerate(found):
            rows = self.found.setdefault(body.name or f'#{place}', [])
            rows.append((log_ns, body))
            if len(rows) > _MAX_POSES:
                raise DataError(f'{self.path}: more than {_MAX_POSES} poses on {self.topic}')

    def poses(self, clock: str) -> _Poses:
        """Return the poses of the requested body."""
        name = self._body()
        rows = self.found[name]
        label = self.topic if len(self.found) == 1 else f'{self.topic}:{name.lstrip("#")}'
        frames = list(dict.fromkeys(body.frame for _, body in rows))
        if len(frames) > 1:
            raise DataError(
                f'{self.path}: {label} changes from frame {frames[0]!r} to {frames[1]!r}'
            )
        stamped = any(body.stamp_ns for _, body in rows)
        unstamped = sum(not body.stamp_ns for _, body in rows) if stamped else 0
        if unstamped and clock == 'stamp':
            # A stamp of zero, as before the first time on a simulated clock.
            rows = [(log_ns, body) for log_ns, body in rows if body.stamp_ns]
        logs = np.array([log_ns for log_ns, _ in rows], dtype=np.int64)
        stamps = np.array([body.stamp_ns for _, body in rows], dtype=np.int64)
        return _Poses(
            label,
            frames[0],
            stamps if stamped and clock == 'stamp' else logs,
            logs - stamps if stamped else np.zeros(0, dtype=np.int64),
            logs,
            np.array([body.seen_position for _, body in rows]),
            np.array([body.orientation or (float('nan'),) * 4 for _, body in rows]),
            unstamped,
        )

    def _body(self) -> str:
        if not self.found:
            raise DataError(f'{self.path}: 0 poses on {self.topic}')
        _, chosen, wanted = self.asked.partition(':')
        names = list(self.found)
        if not chosen:
            if len(names) == 1:
                return names[0]
            known = name_list([name.lstrip('#') for name in names])
            raise DataError(
                f'{self.path}: {self.topic} holds several bodies; '
                f'choose {self.topic}:NAME, of {known}'
            )
        for name in (wanted.lstrip('/'), f'#{wanted}'):
            if name in names:
                if name.startswith('#') and len(self.counts - {0}) > 1:
                    raise DataError(
                        f'{self.path}: {self.topic} holds {min(self.counts - {0})} to '
                        f'{max(self.counts)} poses without names: the bodies cannot be told apart'
                    )
                return name
        known = name_list([name.lstrip('#') for name in names])
        raise DataError(f'{self.path}: no {wanted!r} on {self.topic}; there are {known}')


def _fill(path: Path, streams: Sequence[_Stream]) -> None:
    # Not at the top: mocap files are read without the libraries that bags need.
    from handover_dmp.recording import read_bag

    topics = {stream.topic for stream in streams}
    for topic, message, log_ns in read_bag(path, topics):
        found = bodies(message)
        if found is None:
            raise DataError(f'{path}: {topic} holds no poses')
        for stream in streams:
            if stream.topic == topic:
                stream.take(found, log_ns)


def _part(path: Path, chosen: list[_Poses], part: int | None) -> list[_Poses]:
    """Return the requested part if the clock was set back, otherwise all."""
    jumps = [jumps_back(poses.times_ns) for poses in chosen]
    parts = [
        [poses.cut(piece) for poses, piece in zip(chosen, pieces, strict=True)]
        for pieces in parts_of([poses.logs_ns for poses in chosen], jumps)
    ]
    parts = [pieces for pieces in parts if all(len(poses.times_ns) for poses in pieces)]
    if len(parts) == 1 and part in (None, 1):
        return parts[0]
    lengths = ', '.join(
        f'{number}: {max(np.ptp(poses.times_ns) for poses in pieces) * 1e-9:.2f} s'
        for number, pieces in enumerate(parts, start=1)
    )
    if part is None:
        raise DataError(
            f'{path}: the clock was set back while it was recorded; import one part of it with '
            f'--part ({lengths})'
        )
    if not 1 <= part <= len(parts):
        raise DataError(f'{path}: no part {part}; there are {lengths}')
    return parts[part - 1]


def _check_clocks(path: Path, chosen: Sequence[_Poses]) -> None:
    """Refuse wrists whose clocks drift apart, or a clock that skips a time."""
    steps = [clock_step(poses.delays_ns) for poses in chosen]
    poses, step = max(zip(chosen, steps, strict=True), key=lambda pair: abs(pair[1]))
    # A simulation that stands still does so for both wrists and skips nothing.
    together = all(len(each.delays_ns) for each in chosen) and abs(steps[0] - steps[1]) < STEP_NS
    if step and not (together and -int(np.diff(poses.delays_ns).min()) < STEP_NS):
        raise DataError(
            f'{path}: the clock of {poses.label} was set by {step * 1e-9:+.3f} s while it was '
            'recorded; --clock log uses the times of recording'
        )


def _series(poses: _Poses, zero_ns: int) -> tuple[Array, Array, NDArray[Any]]:
    """Return sorted unique times in s, positions, and when the body was seen."""
    order = np.argsort(poses.times_ns, kind='stable')
    times_ns, positions = poses.times_ns[order], poses.positions[order]
    # With seconds since 1970 a double would resolve only some tenths of a microsecond.
    times = np.asarray((times_ns - zero_ns) * 1e-9, dtype=np.float64)
    again = np.flatnonzero(np.diff(times_ns) == 0) + 1
    apart = np.linalg.norm(positions[again] - positions[again - 1], axis=1)
    if (apart > _SAME_PLACE_M).any():
        at = times[again[np.flatnonzero(apart > _SAME_PLACE_M)[0]]]
        raise DataError(
            f'{poses.label}: at {at:.3f} s two poses with one stamp are '
            f'{np.nanmax(apart):.2g} m apart; do they belong to two bodies?'
        )
    once = np.delete(np.arange(len(times)), again)
    seen = np.asarray(np.isfinite(positions[once]).all(axis=1))
    return times[once], positions[once], seen


def _turns(poses: _Poses, zero_ns: int, at: Array) -> Array | None:
    """Return the orientations of a body at some times, s; None if there are none."""
    times_ns, once = np.unique(poses.times_ns, return_index=True)
    times = np.asarray((times_ns - zero_ns) * 1e-9, dtype=np.float64)
    return orientation_at(times, poses.quaternions[once], at, MAX_HIDDEN_S)


def _remarks(chosen: Sequence[_Poses], clock: str) -> tuple[str, ...]:
    return tuple(_clock_remarks(chosen)) if clock == 'stamp' else ()


def _clock_remarks(chosen: Sequence[_Poses]) -> Iterator[str]:
    stamped = [poses for poses in chosen if len(poses.delays_ns)]
    delays_s = [float(np.median(poses.delays_ns)) * 1e-9 for poses in stamped]
    for poses in stamped:
        if poses.unstamped:
            yield f'{poses.label}: {poses.unstamped} poses without a stamp are left out'
    if len(stamped) == 1 and abs(delays_s[0]) > _SAME_DELAY_S:
        yield (
            f'only {stamped[0].label} is stamped, {delays_s[0]:.3f} s before it was recorded: '
            'the wrists may be apart in time by as much (--clock log uses the times of recording)'
        )
    if len(stamped) == 2 and abs(delays_s[0] - delays_s[1]) > _SAME_DELAY_S:
        yield (
            f'{stamped[0].label} is stamped {delays_s[0]:.3f} s and {stamped[1].label} '
            f'{delays_s[1]:.3f} s before it was recorded: if that is two clocks, the wrists are '
            f'apart in time by {abs(delays_s[0] - delays_s[1]):.3f} s '
            '(--clock log uses the times of recording)'
        )
