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
from dataclasses import dataclass, field, replace
import json
from pathlib import Path
import re

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
    chosen = _read(path, (partner, demonstrator), clock)
    one, other = chosen
    if one.label == other.label:
        raise DataError(f'{path}: P1 and P2 are both {one.label}; choose two bodies')
    if one.frame != other.frame:
        raise DataError(
            f'{path}: {one.label} is in frame {one.frame!r}, {other.label} in {other.frame!r}'
        )
    chosen = _part(path, chosen, part)
    _check_clocks(path, chosen)
    found = Known('m', BY_REP_103) if unit is None else Known(known_unit(unit, path.name), AS_TOLD)
    axis = Known('z', BY_REP_103) if up is None else Known(up, AS_TOLD)
    scale = METRES[found.value]
    zero_ns = int(min(poses.times_ns.min() for poses in chosen))
    ordered = [_by_time(poses, zero_ns) for poses in chosen]
    (partner_times, first), (other_times, second) = (
        (poses.seconds(zero_ns)[poses.seen], scale * poses.positions[poses.seen])
        for poses in ordered
    )
    fewest = min(len(partner_times), len(other_times))
    if fewest < _MIN_POSES:
        short = chosen[0] if len(partner_times) < _MIN_POSES else chosen[1]
        raise DataError(f'{path}: {fewest} poses on {short.label}')
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
    turns = [
        orientation_at(poses.seconds(zero_ns), poses.quaternions, times, MAX_HIDDEN_S)
        for poses in ordered
    ]
    start = float(partner_times[0])
    gaps = [
        gap.since(start)
        for who, poses in zip(('P1', 'P2'), ordered, strict=True)
        for gap in find_gaps(poses.seconds(zero_ns), poses.seen, who)
    ]
    return WristMotion(
        times - start,
        turn_up(first[inside], axis.value),
        turn_up(interpolate(other_times, second)(times), axis.value),
        source=path.name,
        unit=found,
        up=axis,
        gaps=tuple(gaps),
        remarks=(*_clock_remarks(chosen), *(() if up else doubts((first, second), axis.value))),
        partner_orientation=turn_orientation_up(turns[0], axis.value),
        demonstrator_orientation=turn_orientation_up(turns[1], axis.value),
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
    chosen = _part(path, _read(path, asked, clock), part)
    zero_ns = int(min(poses.times_ns.min() for poses in chosen))
    return [
        make_body_path(
            poses.label,
            poses.frame,
            poses.seconds(zero_ns),
            poses.positions,
            poses.quaternions,
            poses.delay_s,
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
        logs_ns: (n,) times of recording.
        positions: (n, 3) m, NaN if the body was not seen.
        quaternions: (n, 4) x, y, z, w, NaN if there are none.
        stamped: whether the times are stamps.
        unstamped: number of further poses without a stamp, if the times are stamps.

    """

    label: str
    frame: str
    times_ns: NDArray[np.int64]
    logs_ns: NDArray[np.int64]
    positions: Array
    quaternions: Array
    stamped: bool
    unstamped: int

    @property
    def delays_ns(self) -> NDArray[np.int64]:
        """From stamp to recording, (n,) ns; 0 without stamps."""
        return self.logs_ns - self.times_ns

    @property
    def delay_s(self) -> float:
        """Median of the delays, s."""
        return float(np.median(self.delays_ns)) * 1e-9

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether the body was seen, (n,)."""
        return np.asarray(np.isfinite(self.positions).all(axis=1))

    def seconds(self, zero_ns: int) -> Array:
        """Return the times since another one, (n,) s."""
        # With seconds since 1970 a double would resolve only some tenths of a microsecond.
        return np.asarray((self.times_ns - zero_ns) * 1e-9, dtype=np.float64)

    def cut(self, part: slice | NDArray[np.intp]) -> _Poses:
        """Return some of the poses."""
        arrays = ('times_ns', 'logs_ns', 'positions', 'quaternions')
        return replace(self, **{name: getattr(self, name)[part] for name in arrays})


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
        stamped = clock == 'stamp' and any(body.stamp_ns for _, body in rows)
        # A stamp may be zero, as before the first time on a simulated clock.
        used = [(log_ns, body) for log_ns, body in rows if body.stamp_ns or not stamped]
        times_ns = [body.stamp_ns if stamped else log_ns for log_ns, body in used]
        return _Poses(
            label,
            frames[0],
            np.array(times_ns, dtype=np.int64),
            np.array([log_ns for log_ns, _ in used], dtype=np.int64),
            np.array([body.seen_position for _, body in used]),
            np.array([body.orientation or (float('nan'),) * 4 for _, body in used]),
            stamped,
            len(rows) - len(used),
        )

    def _body(self) -> str:
        if not self.found:
            raise DataError(f'{self.path}: 0 poses on {self.topic}')
        _, chosen, wanted = self.asked.partition(':')
        names = list(self.found)
        known = name_list([name.lstrip('#') for name in names])
        if not chosen:
            if len(names) == 1:
                return names[0]
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
        raise DataError(f'{self.path}: no {wanted!r} on {self.topic}; there are {known}')


def _read(path: Path, asked: Sequence[str], clock: str) -> list[_Poses]:
    """Return the poses of the requested bodies."""
    # Not at the top: mocap files are read without the libraries that bags need.
    from handover_dmp.recording import read_bag

    streams = [_Stream(path, topic) for topic in asked]
    topics = {stream.topic for stream in streams}
    for topic, message, log_ns in read_bag(path, topics):
        found = bodies(message)
        if found is None:
            raise DataError(f'{path}: {topic} holds no poses')
        for stream in streams:
            if stream.topic == topic:
                stream.take(found, log_ns)
    return [stream.poses(clock) for stream in streams]


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
    together = all(each.stamped for each in chosen) and abs(steps[0] - steps[1]) < STEP_NS
    if step and not (together and -int(np.diff(poses.delays_ns).min()) < STEP_NS):
        raise DataError(
            f'{path}: the clock of {poses.label} was set by {step * 1e-9:+.3f} s while it was '
            'recorded; --clock log uses the times of recording'
        )


def _by_time(poses: _Poses, zero_ns: int) -> _Poses:
    """Sort poses by time; of several with one stamp, the first counts."""
    poses = poses.cut(np.argsort(poses.times_ns, kind='stable'))
    again = np.flatnonzero(np.diff(poses.times_ns) == 0) + 1
    apart = np.linalg.norm(poses.positions[again] - poses.positions[again - 1], axis=1)
    if (apart > _SAME_PLACE_M).any():
        at = poses.seconds(zero_ns)[again[np.argmax(apart > _SAME_PLACE_M)]]
        raise DataError(
            f'{poses.label}: at {at:.3f} s two poses with one stamp are '
            f'{np.nanmax(apart):.2g} m apart; do they belong to two bodies?'
        )
    return poses.cut(np.delete(np.arange(len(poses.times_ns)), again))


def _clock_remarks(chosen: Sequence[_Poses]) -> Iterator[str]:
    stamped = [poses for poses in chosen if poses.stamped]
    delays_s = [poses.delay_s for poses in stamped]
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
