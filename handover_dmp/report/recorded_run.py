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

"""A recorded run as arrays, read from its bag alone; rosbag2 may have recorded it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
import json
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.mocap.message_bodies import bodies
from handover_dmp.recording import bag_files, read_bag, recorded_namespace
from handover_dmp.robot.chain import described_limits
from handover_dmp.robot.effective_limits import DEFAULT, source_summary
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.topics import (
    CLOCK,
    DEMONSTRATOR_POSE,
    DIAGNOSTICS,
    FRAME,
    GRIPPER_COMMAND,
    HAND_FUSED,
    HAND_POSE,
    HAND_TRUTH,
    HARDWARE_ID,
    IK_STATUS,
    INFO,
    JOINT_COMMAND,
    JOINT_STATES,
    names_of_values,
    OBJECT_HOLDER,
    OBJECT_POSE,
    PHASE,
    POSE_COMMAND,
    ROBOT_DESCRIPTION,
    STATE,
    Topic,
    TOPICS,
    TWIST_COMMAND,
    WRIST_POSE,
    WRIST_WRENCH,
)
import numpy as np
from numpy.typing import NDArray

NEEDED = (WRIST_POSE, JOINT_STATES)
# if log times and the clock of the graph differ by more, the recorder used another clock
SAME_CLOCK_NS = 10**9
MIN_SAMPLES = 5
TRACKER = 'tracker'
MAX_JOINTS = 64


@dataclass(frozen=True)
class RecordedLimits:
    """
    Limits of the joints, in the order of the joints of the run.

    Attributes:
        lower: (n,) rad; not finite for a continuous joint.
        upper: (n,) rad; the same.
        velocity: (n,) rad/s.
        acceleration: (n,) rad/s²; not finite if unknown.
        origin: the topic that contains the limits.
        sources: by quantity, where the limits come from, in words.

    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    origin: str
    sources: dict[str, str]


@dataclass(frozen=True)
class NodeStatus:
    """
    The status of a node on `/diagnostics`.

    Attributes:
        time_s: time of the report, s.
        node: name of the node.
        level: 0 if all is well.
        message: status in words.
        values: figures, as text.

    """

    time_s: float
    node: str
    level: int
    message: str
    values: dict[str, str]


@dataclass(frozen=True, eq=False)
class RunRecord:
    """
    A recorded run.

    Times are seconds since the first message, by the stamps of the messages (by arrival if a
    message has no stamp), on the clock of the graph. Positions are in frame `world`, m. Arrays of
    topics that were not recorded are empty.

    Attributes:
        source: the bag or run folder that was read.
        namespace: namespace of the graph.
        info: description of the run, `/handover/info`.
        robot_description: URDF of the arm.
        simulated_clock: whether the graph ran on `/clock`.
        start_ns: time of zero, ns.
        hand_times: (a,) s, and
        hand_positions: (a, 3) m, the partner's wrist: the true one if it was recorded, otherwise
            the tracked one, with several trackers the fused one.
        hand_topic: the topic of these.
        fused_times: (z,) s, and
        fused_positions: (z, 3) m, the hand as estimated by `dmp`.
        trackers: by name, (k,) s and (k, 3) m, the hand as seen by each tracker.
        demonstrator_times: (b,) s, and
        demonstrator_positions: (b, 3) m, the demonstrator's wrist.
        wrist_times: (c,) s, and
        wrist_positions: (c, 3) m, the robot's measured wrist, and
        wrist_quaternions: (c, 4) x, y, z, w, its orientation.
        command_times: (d,) s, and
        command_positions: (d, 3) m, commanded positions of the wrist.
        twist_times: (e,) s, and
        twist_velocities: (e, 3) m/s, commanded velocities of the wrist.
        joint_names: n names.
        joint_times: (f,) s.
        joint_positions: (f, n) rad.
        joint_velocities: (f, n) rad/s.
        joint_command_times: (g,) s, and
        joint_commands: (g, n) rad/s.
        joint_limits: limits to judge by: of the recorded description, or, without one, of `info`;
            None if neither has them.
        believed_limits: limits in `info`, as the controller assumed them; None if it has none.
        phase_times: (h,) s.
        phase: by name, (h,), the values of `/handover/phase`.
        ik_times: (k,) s.
        ik: by name, (k,), the values of `/wrist/ik_status`.
        states: time in s and name of every state of the handover, in order.
        gripper: time in s of every gripper command, and whether it was to close.
        holders: time in s and the holder of the object from then on, if one was simulated.
        wrench_times: (q,) s, and
        wrench_forces: (q, 3) N, force on the wrist, in frame `world`, if it was given there.
        object_times: (r,) s, and
        object_positions: (r, 3) m, position of the object.
        diagnostics: status reports of the nodes.
        arrivals: by topic, (m,) s, times of recording, in order.
        stamps: by topic, (m,) s, stamps, in order.

    """

    source: Path
    namespace: str
    info: dict[str, Any]
    robot_description: str
    simulated_clock: bool
    start_ns: int
    hand_times: Array
    hand_positions: Array
    hand_topic: str
    fused_times: Array
    fused_positions: Array
    trackers: dict[str, tuple[Array, Array]]
    demonstrator_times: Array
    demonstrator_positions: Array
    wrist_times: Array
    wrist_positions: Array
    wrist_quaternions: Array
    command_times: Array
    command_positions: Array
    twist_times: Array
    twist_velocities: Array
    joint_names: tuple[str, ...]
    joint_times: Array
    joint_positions: Array
    joint_velocities: Array
    joint_command_times: Array
    joint_commands: Array
    joint_limits: RecordedLimits | None
    believed_limits: RecordedLimits | None
    phase_times: Array
    phase: dict[str, Array]
    ik_times: Array
    ik: dict[str, Array]
    states: tuple[tuple[float, str], ...]
    gripper: tuple[tuple[float, bool], ...]
    holders: tuple[tuple[float, str], ...]
    wrench_times: Array
    wrench_forces: Array
    object_times: Array
    object_positions: Array
    diagnostics: tuple[NodeStatus, ...]
    arrivals: dict[str, Array]
    stamps: dict[str, Array]

    def time_of(self, state: str) -> float | None:
        """Return when a state was first entered, s; None if it never was."""
        return next((time_s for time_s, name in self.states if name == state), None)

    @property
    def reaching_time_s(self) -> float | None:
        """When the arm began to reach, s."""
        return self.time_of('reaching')

    @property
    def exchange_time_s(self) -> float | None:
        """When the exchange began, s."""
        return self.time_of('exchange')

    @property
    def end_time_s(self) -> float:
        """Time of the last message of arm and hand, s."""
        return float(max(self.wrist_times[-1], self.joint_times[-1], self.hand_times[-1]))

    @property
    def exchange_span_s(self) -> tuple[float, float] | None:
        """Begin and end of the exchange, s; None if there was none."""
        begin = self.exchange_time_s
        if begin is None:
            return None
        after = [time_s for time_s, name in self.states if time_s > begin and name != 'exchange']
        return begin, min([*after, self.end_time_s])

    @property
    def handover_span_s(self) -> tuple[float, float]:
        """Start of the reach and end of the exchange, s; without them, those of the run."""
        span = self.exchange_span_s
        return self.reaching_time_s or 0.0, span[1] if span else self.end_time_s

    @property
    def handed_over(self) -> bool:
        """Whether the object changed hands."""
        return any(name == 'done' for _, name in self.states)

    @property
    def goal_offset(self) -> Array:
        """(3,) m: goal of the wrist minus hand, from the learnt model; zeros if unknown."""
        return _vector(self.info.get('goal_offset_m'), 3, self.source)

    @property
    def learnt_distance_m(self) -> float | None:
        """Distance from the start of the demonstration to the hand at its end, m."""
        distance = self.info.get('learnt_distance_m')
        return float(distance) if isinstance(distance, int | float) and distance > 0 else None


def load_run(path: Path | str, namespace: str | None = None) -> RunRecord:
    """
    Read a recorded run.

    Args:
        path: the folder of a run, the folder of its bag, or its MCAP file.
        namespace: namespace of the graph, if the bag contains several; None: the only one.

    Returns:
        The run as arrays; its topics are named as in the root namespace.

    Raises:
        DataError: the bag is missing, damaged or not of a run, or it contains several graphs and
            none is chosen.

    """
    path = Path(path)
    bag_files(path)
    space = recorded_namespace(path, NEEDED, namespace)
    trackers = _trackers(path, space)
    samples = _collect(path, space, list(trackers.values()))
    hand = _topic_of_hand(samples, list(trackers.values()))
    for topic in (hand, *NEEDED):
        if len(samples.values[topic.name]) < MIN_SAMPLES:
            count = len(samples.values[topic.name])
            raise DataError(f'{path}: not a recorded run: {count} messages on {topic.name}')
    return _assemble(path, samples, hand, trackers)


def _trackers(path: Path, namespace: str) -> dict[str, Topic]:
    """Return the trackers and their topics from the description of the run."""
    texts = [str(message.data) for _, message, _ in read_bag(path, [INFO.within(namespace)])]
    told = _info(path, texts).get('trackers') or {TRACKER: HAND_POSE.name}
    if not isinstance(told, dict) or not all(isinstance(name, str) for name in told.values()):
        raise DataError(f'{path}: {INFO.name}: trackers: not names with topics')
    return {name: replace(HAND_POSE, name=topic) for name, topic in told.items()}


def _topic_of_hand(samples: _Samples, trackers: Sequence[Topic]) -> Topic:
    """Return the topic with the best knowledge of the hand."""
    tracked = trackers[0] if len(trackers) == 1 else HAND_FUSED
    known = [topic for topic in (HAND_TRUTH, tracked) if samples.values[topic.name]]
    return known[0] if known else HAND_POSE


class _Samples:
    """The needed parts of the messages of a bag."""

    def __init__(self) -> None:
        self.values: dict[str, list[Any]] = defaultdict(list)
        self.stamps_ns: dict[str, list[int]] = defaultdict(list)
        self.logs_ns: dict[str, list[int]] = defaultdict(list)
        self.labels: dict[str, tuple[str, ...]] = {}
        self.namespace = '/'

    def graph_time(self) -> Callable[[Sequence[int]], NDArray[np.int64]]:
        """Return the function from the recorder's clock to that of the graph, ns."""
        log_ns = np.array(self.logs_ns[CLOCK.name], dtype=np.int64)
        clock_ns = np.array(self.values[CLOCK.name], dtype=np.int64)
        shift = np.abs(log_ns - clock_ns)
        if len(log_ns) < 2 or np.median(shift) < SAME_CLOCK_NS:
            return lambda times_ns: np.array(times_ns, dtype=np.int64)
        order = np.argsort(log_ns, kind='stable')
        log_ns, clock_ns = log_ns[order], clock_ns[order]

        def convert(times_ns: Sequence[int]) -> NDArray[np.int64]:
            # differences, because a double cannot hold the nanoseconds since 1970
            elapsed = np.array(times_ns, dtype=np.int64) - log_ns[0]
            known = np.interp(elapsed, log_ns - log_ns[0], clock_ns - clock_ns[0])
            converted: NDArray[np.int64] = clock_ns[0] + np.rint(known).astype(np.int64)
            return converted

        return convert


def _collect(path: Path, namespace: str, trackers: Sequence[Topic]) -> _Samples:
    samples = _Samples()
    readers: dict[str, Callable[[Any], Any]] = {
        CLOCK.name: lambda message: _nanoseconds(message.clock),
        **{topic.name: _seen for topic in trackers},
        HAND_TRUTH.name: _position,
        HAND_FUSED.name: lambda message: _xyz(message.pose.pose.position),
        DEMONSTRATOR_POSE.name: _position,
        WRIST_POSE.name: lambda message: (*_position(message), *_xyzw(message)),
        POSE_COMMAND.name: _position,
        TWIST_COMMAND.name: lambda message: _xyz(message.twist.linear),
        JOINT_STATES.name: lambda message: (
            tuple(message.name), tuple(message.position), tuple(message.velocity),
        ),
        JOINT_COMMAND.name: lambda message: list(message.data),
        STATE.name: lambda message: str(message.data),
        GRIPPER_COMMAND.name: lambda message: bool(message.data),
        OBJECT_HOLDER.name: lambda message: str(message.data),
        OBJECT_POSE.name: _position,
        WRIST_WRENCH.name: _force,
        PHASE.name: lambda message: list(message.data),
        IK_STATUS.name: lambda message: list(message.data),
        DIAGNOSTICS.name: lambda message: list(message.status),
        ROBOT_DESCRIPTION.name: lambda message: str(message.data),
        INFO.name: lambda message: str(message.data),
    }  # fmt: skip
    names = {
        topic.within(namespace): topic.name
        for topic in (*TOPICS, *trackers)
        if topic.name in readers
    }
    samples.namespace = namespace
    for name, message, log_ns in read_bag(path, names):
        topic = names[name]
        try:
            value = readers[topic](message)
            header = getattr(message, 'header', None)
            stamp_ns = 0 if header is None else _nanoseconds(header.stamp)
            if topic in (PHASE.name, IK_STATUS.name):
                labels = names_of_values(message)
                if samples.labels.setdefault(topic, labels) != labels or len(labels) != len(value):
                    raise DataError(f'{path}: {topic}: values without their names')
        except AttributeError as error:
            raise DataError(f'{path}: {topic}: messages of another type: {error}') from error
        samples.values[topic].append(value)
        samples.stamps_ns[topic].append(stamp_ns)
        samples.logs_ns[topic].append(log_ns)
    return samples


def _assemble(
    path: Path, samples: _Samples, hand_topic: Topic, trackers: dict[str, Topic]
) -> RunRecord:
    needed = (hand_topic, *NEEDED)
    graph_time = samples.graph_time()
    arrivals_ns = {topic: graph_time(times) for topic, times in samples.logs_ns.items()}
    stamps_ns = _stamps_ns(samples, arrivals_ns)
    start_ns = int(min(stamps_ns[topic.name].min() for topic in needed))
    stamps = _seconds(stamps_ns, start_ns)
    arrivals = _seconds(arrivals_ns, start_ns)
    track = partial(_track, path, samples, stamps)

    def fields(name: str, topic: Topic, what: str = 'positions') -> dict[str, Any]:
        times, values = track(topic, 3)
        return {f'{name}_times': times, f'{name}_{what}': values}

    info = _info(path, samples.values[INFO.name])
    hand_times, hand = track(hand_topic, 3)
    wrist_times, wrist = track(WRIST_POSE, 7)
    phase_labels = samples.labels.get(PHASE.name, ())
    ik_labels = samples.labels.get(IK_STATUS.name, ())
    phase_times, phase = track(PHASE, len(phase_labels) or 1)
    # an arm with unknown joints still reports that it is not commanded
    ik_times, ik = track(IK_STATUS, len(ik_labels) or 1, partly=True)
    joints = _joint_motions(path, samples, stamps, info)
    for wanted, times in zip(
        needed, (hand_times, wrist_times, joints['joint_times']), strict=True
    ):
        if len(times) < MIN_SAMPLES:
            raise DataError(f'{path}: not a recorded run: {wanted.name} has no proper positions')
    return RunRecord(
        source=path,
        namespace=samples.namespace,
        info=info,
        simulated_clock=bool(samples.values[CLOCK.name]),
        start_ns=start_ns,
        hand_times=hand_times,
        hand_positions=hand,
        hand_topic=hand_topic.name,
        **fields('fused', HAND_FUSED),
        trackers={name: track(topic, 3) for name, topic in trackers.items()},
        **fields('demonstrator', DEMONSTRATOR_POSE),
        wrist_times=wrist_times,
        wrist_positions=wrist[:, :3],
        wrist_quaternions=wrist[:, 3:],
        **fields('command', POSE_COMMAND),
        **fields('twist', TWIST_COMMAND, 'velocities'),
        phase_times=phase_times,
        phase={label: phase[:, column] for column, label in enumerate(phase_labels)},
        ik_times=ik_times,
        ik={label: ik[:, column] for column, label in enumerate(ik_labels)},
        states=_told(samples, arrivals, STATE),
        gripper=_told(samples, arrivals, GRIPPER_COMMAND),
        holders=_told(samples, arrivals, OBJECT_HOLDER),
        **fields('wrench', WRIST_WRENCH, 'forces'),
        **fields('object', OBJECT_POSE),
        diagnostics=tuple(_diagnostics(samples, stamps)),
        arrivals=arrivals,
        stamps=stamps,
        **joints,
    )


def _stamps_ns(
    samples: _Samples, arrivals_ns: dict[str, NDArray[np.int64]]
) -> dict[str, NDArray[np.int64]]:
    """Return the stamps of each topic, ns; the arrivals where there are none."""
    stamps_ns = {
        # a stamp of zero means no stamp
        topic: np.where(np.array(stamps) > 0, np.array(stamps, dtype=np.int64), arrivals_ns[topic])
        for topic, stamps in samples.stamps_ns.items()
    }
    for topic in (PHASE.name, IK_STATUS.name):
        if 'time_s' in samples.labels.get(topic, ()):
            column = samples.labels[topic].index('time_s')
            seconds = np.array([row[column] for row in samples.values[topic]])
            stamps_ns[topic] = np.rint(seconds * 1e9).astype(np.int64)
    return stamps_ns


def _track(
    path: Path,
    samples: _Samples,
    stamps: dict[str, Array],
    topic: Topic,
    width: int,
    *,
    partly: bool = False,
) -> tuple[Array, Array]:
    """Return times (k,), s, and values (k, width) of a topic, in order."""
    if not samples.values.get(topic.name):
        return np.zeros(0), np.zeros((0, width))
    try:
        values = np.array(samples.values[topic.name], dtype=np.float64).reshape(-1, width)
    except ValueError as error:
        raise DataError(f'{path}: {topic.name}: messages of different lengths') from error
    return _in_order(stamps[topic.name], values, partly=partly)


def _joint_motions(
    path: Path, samples: _Samples, stamps: dict[str, Array], info: dict[str, Any]
) -> dict[str, Any]:
    """Return the fields of a `RunRecord` about the joints."""
    names, rows, told_velocities = _joints(path, samples.values[JOINT_STATES.name], info)
    count = len(names)
    times, joints = _in_order(stamps[JOINT_STATES.name], rows)
    if not told_velocities and len(times) > 1:
        joints[:, count:] = np.gradient(joints[:, :count], times, axis=0)
    command_times, commands = np.zeros(0), np.zeros((0, count))
    if all(len(row) == count for row in samples.values[JOINT_COMMAND.name]):
        command_times, commands = _track(path, samples, stamps, JOINT_COMMAND, count)
    description = next(iter(samples.values[ROBOT_DESCRIPTION.name]), '')
    believed = _believed_limits(path, info, names)
    return {
        'robot_description': description,
        'joint_names': names,
        'joint_times': times,
        'joint_positions': joints[:, :count],
        'joint_velocities': joints[:, count:],
        'joint_command_times': command_times,
        'joint_commands': commands,
        'joint_limits': _described_limits(description, names, believed) or believed,
        'believed_limits': believed,
    }


def _told(
    samples: _Samples, arrivals: dict[str, Array], topic: Topic
) -> tuple[tuple[float, Any], ...]:
    """Return the messages of a topic without stamps, and their times, s."""
    times = arrivals.get(topic.name, np.zeros(0)).tolist()
    return tuple(zip(times, samples.values[topic.name], strict=True))


def _seconds(times_ns: dict[str, NDArray[np.int64]], start_ns: int) -> dict[str, Array]:
    return {topic: np.array((times - start_ns) * 1e-9) for topic, times in times_ns.items()}


def _in_order(times: Array, values: Array, *, partly: bool = False) -> tuple[Array, Array]:
    """
    Sort by time; drop NaN, and all but the first of equal times.

    Args:
        times: s, (k,).
        values: (k, n).
        partly: keep rows in which only some values are numbers.

    Returns:
        The remaining times and values.

    """
    numbers = np.isfinite(values)
    sound = (numbers.any(axis=1) if partly else numbers.all(axis=1)) & np.isfinite(times)
    times, values = times[sound], values[sound]
    times, index = np.unique(times, return_index=True)
    return times, values[index]


def _joints(
    path: Path, rows: list[Any], info: dict[str, Any]
) -> tuple[tuple[str, ...], Array, bool]:
    """Sort every joint state like the run's description, or else like the first one."""
    told = info.get('joint_names')
    names: tuple[str, ...] = rows[0][0]
    if isinstance(told, list) and set(told) == set(names):
        names = tuple(told)
    if not 0 < len(names) <= MAX_JOINTS or len(set(names)) != len(names):
        raise DataError(f'{path}: {JOINT_STATES.name}: {len(names)} joints of {len(set(names))}')
    # velocities are optional in a joint state
    told_velocities = all(len(row[2]) == len(row[0]) for row in rows)
    ordered = []
    for own_names, positions, velocities in rows:
        if set(own_names) != set(names) or len(positions) != len(own_names):
            raise DataError(f'{path}: {JOINT_STATES.name}: not always of the same joints')
        place = {name: index for index, name in enumerate(own_names)}
        if not told_velocities:
            velocities = (0.0,) * len(own_names)
        ordered.append(
            [positions[place[name]] for name in names]
            + [velocities[place[name]] for name in names]
        )
    return names, np.array(ordered, dtype=np.float64), told_velocities


def _info(path: Path, texts: list[str]) -> dict[str, Any]:
    if not texts:
        return {}
    try:
        info = json.loads(texts[0])
    except (ValueError, RecursionError) as error:
        raise DataError(f'{path}: {INFO.name}: not JSON: {error}') from error
    if not isinstance(info, dict):
        raise DataError(f'{path}: {INFO.name}: not a JSON object')
    return info


def _believed_limits(
    path: Path, info: dict[str, Any], names: tuple[str, ...]
) -> RecordedLimits | None:
    told = info.get('joint_limits')
    if not isinstance(told, dict):
        return None
    lower, upper, velocity, acceleration = (
        _vector(told.get(key), len(names), path)
        for key in ('lower', 'upper', 'velocity', 'acceleration')
    )
    return RecordedLimits(lower, upper, velocity, acceleration, INFO.name, {})


def _described_limits(
    description: str, names: tuple[str, ...], believed: RecordedLimits | None
) -> RecordedLimits | None:
    """Read the limits from the robot description, whatever the controller assumed."""
    if not description:
        return None
    try:
        found = described_limits(description, names, ROBOT_DESCRIPTION.name)
    except RobotDescriptionError:
        return None
    limits = found.limits
    # a description need not contain acceleration limits; then those of the controller count, but
    # only up to the usual ones
    told = np.full(len(names), np.nan) if believed is None else believed.acceleration
    guessed = np.array(found.sources['acceleration']) == DEFAULT
    at_most = np.where(told > 0.0, np.minimum(told, limits.acceleration), np.nan)
    return RecordedLimits(
        limits.lower,
        limits.upper,
        limits.velocity,
        np.where(guessed, at_most, limits.acceleration),
        ROBOT_DESCRIPTION.name,
        source_summary(found.sources, names),
    )


def _vector(value: Any, count: int, path: Path) -> Array:
    if value is None:
        return np.zeros(count)
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f'{path}: {INFO.name}: {value!r} is not a vector'[:300]) from error
    if vector.shape != (count,):
        raise DataError(f'{path}: {INFO.name}: {vector.shape} numbers instead of {count}')
    return vector


def _diagnostics(samples: _Samples, stamps: dict[str, Array]) -> list[NodeStatus]:
    found = []
    for time_s, statuses in zip(
        stamps.get(DIAGNOSTICS.name, ()), samples.values[DIAGNOSTICS.name], strict=True
    ):
        for status in statuses:
            node = str(status.name)
            if status.hardware_id == HARDWARE_ID:
                space, _, node = node.rpartition('/')
                if space != samples.namespace.strip('/'):
                    # from another graph
                    continue
            values = {str(pair.key): str(pair.value) for pair in status.values}
            found.append(
                NodeStatus(float(time_s), node, int(status.level), str(status.message), values)
            )
    return found


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _xyzw(message: Any) -> tuple[float, float, float, float]:
    turn = message.pose.orientation
    return (turn.x, turn.y, turn.z, turn.w)


def _xyz(vector: Any) -> tuple[float, float, float]:
    return (vector.x, vector.y, vector.z)


def _force(message: Any) -> tuple[float, float, float]:
    return _xyz(message.wrench.force) if message.header.frame_id == FRAME else (np.nan,) * 3


def _seen(message: Any) -> tuple[float, float, float]:
    """Return the hand's position in a tracker message of any type, NaN if it has none."""
    found = bodies(message)
    if found is None:
        raise AttributeError(f'{type(message).__name__} holds no position')
    return found[0].seen_position if found else (np.nan,) * 3


def _position(message: Any) -> tuple[float, float, float]:
    return _xyz(message.pose.position)
