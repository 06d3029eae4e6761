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

"""
Bags with any mix of their oddities, written by `rosbags`: the truth comes out, or a refusal.

Two hands move by a known law. What the tracker, the network, the clock and the recorder do to the
messages is drawn: rates, late and doubled messages, lost bodies in all ways in which trackers say
so, clocks apart or set while it was recorded, bodies side by side on one topic, stamps of zero.
"""

from __future__ import annotations

from dataclasses import dataclass
import shutil

from handover_dmp.common.errors import DataError
from handover_dmp.mocap.bag import read_bag_wrists
from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

pytest.importorskip('mcap')
rosbag2 = pytest.importorskip('rosbags.rosbag2')
typesys = pytest.importorskip('rosbags.typesys')

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
TYPES = STORE.types
DURATION_S = 2.0
# No hand is faster nor turns quicker than those of the law below.
MAX_SPEED, MAX_ACCELERATION = 0.8, 2.5
MAX_HIDDEN_S = 0.25
KINDS = [
    'geometry_msgs/msg/PoseStamped', 'geometry_msgs/msg/PointStamped',
    'geometry_msgs/msg/TransformStamped', 'geometry_msgs/msg/PoseWithCovarianceStamped',
    'nav_msgs/msg/Odometry', 'geometry_msgs/msg/PoseArray', 'visualization_msgs/msg/MarkerArray',
]  # fmt: skip
LOSSES = ('zeros', 'nan', 'one nan', 'no rotation', 'covariance', 'silence')


def law(times):
    """Return where both hands are, m: (n, 3) each."""
    u = np.clip((np.asarray(times) - 0.3) / 1.4, 0.0, 1.0)[:, None]
    shape = 10 * u**3 - 15 * u**4 + 6 * u**5
    first = np.array([1.2, 0.3, 1.0]) + shape * [-0.5, -0.1, 0.1]
    return first, np.array([0.0, 0.05, 0.9]) + shape * [0.5, 0.15, 0.2]


@dataclass(frozen=True)
class Stream:
    """What became of the messages of one hand."""

    kind: str
    rate_hz: float
    phase_s: float
    starts_s: float
    lost: list[tuple[float, float]]
    loss: str
    late: bool
    doubled: bool
    stamped: bool
    delay_s: float
    set_s: float

    @property
    def times(self) -> np.ndarray:
        return np.arange(self.starts_s + self.phase_s, DURATION_S, 1.0 / self.rate_hz)

    def hidden(self, times) -> np.ndarray:
        spans = [(times >= begin) & (times < begin + length) for begin, length in self.lost]
        return np.any([np.zeros(len(times), bool), *spans], axis=0)

    def messages(self, hand: int, epoch_s: float):
        """Yield (log time in s, stamp in s, place, lost), as they were recorded."""
        rows = []
        for time, place, gone in zip(
            self.times, law(self.times)[hand], self.hidden(self.times), strict=True
        ):
            if gone and self.loss == 'silence':
                continue
            stamp = epoch_s + time - self.delay_s + (self.set_s if time > 1.0 else 0.0)
            rows.append((epoch_s + time + 0.001, stamp if self.stamped else 0.0, place, gone))
        if self.late:
            for k in range(5, len(rows) - 5, 11):
                # The messages change places, the times of recording do not.
                (early, *one), (later, *other) = rows[k: k + 2]  # fmt: skip
                if later - early > 0.1:
                    continue
                rows[k: k + 2] = [(early, *other), (later, *one)]  # fmt: skip
        if self.doubled:
            rows = [row for k, row in enumerate(rows) for _ in range(1 + (k % 7 == 3))]
        return rows


def stamp_of(seconds):
    whole, rest = divmod(round(seconds * 1e9), 10**9)
    return TYPES['builtin_interfaces/msg/Time'](sec=whole, nanosec=rest)


def message(kind, stamp_s, place, loss, name):
    """Make a message of a kind; `loss` says how a lost body is told, if it is one."""
    make = {key.rpartition('/')[2]: value for key, value in TYPES.items() if '/msg/' in key}
    if loss == 'zeros':
        place = np.zeros(3)
    elif loss == 'nan':
        place = np.full(3, np.nan)
    elif loss == 'one nan':
        place = np.array([place[0], np.nan, place[2]])
    header = make['Header'](stamp=stamp_of(stamp_s), frame_id='world')
    point = make['Point'](*map(float, place))
    turn = make['Quaternion'](0.0, 0.0, 0.0, 0.0 if loss == 'no rotation' else 1.0)
    pose = make['Pose'](position=point, orientation=turn)
    covariance = np.zeros(36)
    if loss == 'covariance':
        covariance[0] = -1.0
    with_covariance = make['PoseWithCovariance'](pose=pose, covariance=covariance)
    short = kind.rpartition('/')[2]
    if short == 'PointStamped':
        return make[short](header=header, point=point)
    if short == 'TransformStamped':
        way = make['Vector3'](*map(float, place))
        transform = make['Transform'](translation=way, rotation=turn)
        return make[short](header=header, child_frame_id=name, transform=transform)
    if short == 'PoseWithCovarianceStamped':
        return make[short](header=header, pose=with_covariance)
    if short == 'Odometry':
        still = make['Twist'](make['Vector3'](0.0, 0.0, 0.0), make['Vector3'](0.0, 0.0, 0.0))
        twist = make['TwistWithCovariance'](twist=still, covariance=np.zeros(36))
        return make[short](header=header, child_frame_id=name, pose=with_covariance, twist=twist)
    if short == 'PoseArray':
        return make[short](header=header, poses=[pose])
    if short == 'MarkerArray':
        nothing = np.zeros(0, np.uint8)
        marker = TYPES['visualization_msgs/msg/Marker'](
            header=header, ns=name, id=7, type=2, action=0, pose=pose,
            scale=make['Vector3'](0.1, 0.1, 0.1), color=make['ColorRGBA'](0.0, 0.0, 0.0, 1.0),
            lifetime=make['Duration'](0, 0), frame_locked=False, points=[], colors=[],
            texture_resource='', texture=make['CompressedImage'](header, '', nothing),
            uv_coordinates=[], text='', mesh_resource='',
            mesh_file=TYPES['visualization_msgs/msg/MeshFile']('', nothing),
            mesh_use_embedded_materials=False,
        )  # fmt: skip
        return make[short](markers=[marker])
    return make[short](header=header, pose=pose)


def told(kind: str, loss: str) -> str:
    """Return how a body can be told to be lost in a message of this kind."""
    if loss == 'covariance' and kind.rpartition('/')[2] not in (
        'PoseWithCovarianceStamped',
        'Odometry',
    ):
        return 'zeros'
    return 'nan' if loss == 'no rotation' and kind.endswith('PointStamped') else loss


@dataclass(frozen=True)
class Bag:
    """A bag of both hands."""

    streams: tuple[Stream, Stream]
    epoch_s: float
    one_topic: bool
    storage: str
    mode: str | None

    def write(self, folder):
        shutil.rmtree(folder, ignore_errors=True)
        topics = ['/bodies', '/bodies'] if self.one_topic else ['/a', '/b']
        bag = rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin[self.storage])
        if self.mode:
            bag.set_compression(rosbag2.CompressionMode[self.mode], rosbag2.CompressionFormat.ZSTD)
        rows = [
            (row, hand)
            for hand, stream in enumerate(self.streams)
            for row in stream.messages(hand, self.epoch_s)
        ]
        with bag as writer:
            known = {}
            for (log_s, stamp_s, place, gone), hand in sorted(rows, key=lambda item: item[0][0]):
                kind = self.streams[hand].kind
                if topics[hand] not in known:
                    known[topics[hand]] = writer.add_connection(
                        topics[hand], kind, typestore=STORE
                    )
                loss = told(kind, self.streams[hand].loss) if gone else ''
                data = STORE.serialize_cdr(
                    message(kind, stamp_s, place, loss, f'hand{hand}'), kind
                )
                writer.write(known[topics[hand]], round(log_s * 1e9), data)
        return folder


def streams(kind, one_topic):
    gap = st.tuples(st.floats(0.2, 1.7), st.floats(0.01, 0.4))
    return st.builds(
        Stream,
        kind=st.just(kind) if kind else st.sampled_from(KINDS),
        rate_hz=st.sampled_from([50.0, 100.0, 120.0, 200.0]),
        phase_s=st.sampled_from([0.0, 0.003]),
        starts_s=st.sampled_from([0.0, 0.0, 0.15]),
        lost=st.lists(gap, max_size=2),
        loss=st.sampled_from(LOSSES),
        late=st.booleans(),
        doubled=st.booleans(),
        stamped=st.just(True) if one_topic else st.sampled_from([True, True, True, False]),
        delay_s=st.sampled_from([0.0, 0.0, 0.0, 0.3]),
        set_s=st.sampled_from([0.0, 0.0, 0.0, 0.0, -0.3, -50.0, 0.2]),
    )


@st.composite
def bags(draw):
    one_topic = draw(st.booleans())
    named = st.sampled_from(['geometry_msgs/msg/TransformStamped', 'nav_msgs/msg/Odometry',
                             'visualization_msgs/msg/MarkerArray'])  # fmt: skip
    kind = draw(named) if one_topic else None
    return Bag(
        (draw(streams(kind, one_topic)), draw(streams(kind, one_topic))),
        draw(st.sampled_from([100.0, 1.7e9])),
        one_topic,
        draw(st.sampled_from(['MCAP', 'SQLITE3'])),
        draw(st.sampled_from([None, 'FILE', 'MESSAGE'])),
    )


def names(bag: Bag):
    if not bag.one_topic:
        return '/a', '/b'
    ending = '/7' if bag.streams[0].kind.endswith('MarkerArray') else ''
    return f'/bodies:hand0{ending}', f'/bodies:hand1{ending}'


def bridged(stream: Stream, times) -> np.ndarray:
    """Return for each time how long the hand was not seen around it, s."""
    seen = stream.times[~stream.hidden(stream.times)]
    after = np.clip(np.searchsorted(seen, times - 1e-9), 1, len(seen) - 1)
    return seen[after] - seen[after - 1]


@given(bag=bags())
# Some seconds: fewer bags would not have every oddity with every other.
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_mix_gives_the_truth_or_is_refused(tmp_path, bag):
    folder = bag.write(tmp_path / 'bag')
    set_back = any(stream.set_s < 0.0 and stream.stamped for stream in bag.streams)
    was_set = any(stream.set_s and stream.stamped for stream in bag.streams)
    try:
        motion = read_bag_wrists(folder, *names(bag))
    except DataError as error:
        text = str(error)
        assert '\n' not in text
        # Nothing else may be refused than clocks that were set back, or that have nothing to do
        # with each other.
        apart = bag.streams[0].stamped != bag.streams[1].stamped or any(
            stream.set_s for stream in bag.streams
        )
        assert (
            (set_back and '--part' in text)
            or (was_set and 'was set by' in text)
            or (apart and 'do not overlap' in text)
        ), text
        return
    assert not was_set
    said = ' '.join(motion.remarks)
    first, second = bag.streams
    clocks = [stream.delay_s if stream.stamped else -0.001 for stream in bag.streams]
    by_log = not all(stream.stamped for stream in bag.streams)
    if abs(clocks[0] - clocks[1]) > 0.02:
        assert '--clock log' in said
        motion = read_bag_wrists(folder, *names(bag), clock='log')
        by_log = True
    times = motion.times + first.times[~first.hidden(first.times)][0]
    # By the time of recording a message is late as it came.
    late = by_log and (first.late or second.late)
    slack_s = 0.002 + late * 2.0 / min(first.rate_hz, second.rate_hz)
    slack = slack_s * MAX_SPEED
    partner, demonstrator = law(times)
    assert np.abs(motion.partner - partner).max() <= slack + 1e-6
    error = np.linalg.norm(motion.demonstrator - demonstrator, axis=1)
    gaps = bridged(second, times)
    bound = slack + MAX_ACCELERATION * gaps**2 / 8.0 + 1e-6
    # A spline across a gap goes on as the last messages before it say, which came late.
    assert (error <= bound)[~(late & (gaps > 3.0 / second.rate_hz))].all()
    # Where a hand was not seen for longer than that, nothing is made up.
    surely = np.minimum(bridged(second, times - slack_s), bridged(second, times + slack_s))
    assert surely.max() <= MAX_HIDDEN_S + 3.0 / second.rate_hz
    hidden = first.hidden(times) & first.hidden(times - slack_s) & first.hidden(times + slack_s)
    assert not hidden.any()


@given(bag=bags(), which=st.integers(0, 1))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_bodies_on_one_topic_are_never_mixed(tmp_path, bag, which):
    if not bag.one_topic:
        return
    folder = bag.write(tmp_path / 'bag')
    asked = [*names(bag)]
    asked[which] = '/bodies'
    with pytest.raises(DataError, match=r'holds several bodies; choose /bodies:NAME, of .*hand'):
        read_bag_wrists(folder, *asked)
