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

"""Node `hand_tracker`: replays the recorded wrist of the partner as a tracker would see it."""

from __future__ import annotations

import sys
from time import sleep

from geometry_msgs.msg import PoseStamped
from handover_dmp.common.errors import UsageError
from handover_dmp.handover.recordings import recorded_session, recorded_trial
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds, pose_message, stamp
from handover_dmp.nodes.diagnostics import report_condition
from handover_dmp.nodes.lockstep import Lockstep
from handover_dmp.nodes.node import HandoverNode
from handover_dmp.nodes.parameters import fixed, Values
from handover_dmp.nodes.spin import run
from handover_dmp.nodes.tracker_parameters import plain, TOPIC, TRACKERS
from handover_dmp.topics import (
    CLOCK,
    DEMONSTRATOR_POSE,
    GRIPPER_COMMAND,
    HAND_POSE,
    HAND_TRUTH,
    OBJECT_HOLDER,
    SIGNAL,
    WRIST_POSE,
)
from handover_dmp.tracking.playback import HandSample, PlayedBag, PlayedTrial
from handover_dmp.tracking.sensor_model import FAULTS, SensorModel
from handover_dmp.tracking.session_playback import PlayedSession
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, Header, String

LOOK_S = 0.1
SENSOR = (
    fixed('sensor.rate_hz', 'Rate of the poses, Hz; 0: rate_hz', 0.0, 1000.0),
    fixed('sensor.noise_m', 'Standard deviation of the noise on each axis, m', 0.0, 1.0),
    fixed('sensor.delay_s', 'Delay from measurement to arrival, s', 0.0, 5.0),
    fixed('sensor.dropout', 'Share of lost poses', 0.0, 1.0),
    fixed('sensor.outliers', 'Share of outliers', 0.0, 1.0),
    fixed('sensor.seed', 'Seed of the random numbers', 0, 2**31 - 1),
    fixed('sensor.offset_m', 'Constant offset of all poses, m'),
    fixed('sensor.clock_s', 'Error of the stamps, s; positive: too late', -5.0, 5.0),
    fixed('sensor.fault', 'Fault of the tracker during the motion', choices=FAULTS),
    fixed('sensor.fault_at_s', 'Time of the fault, after the start, s', 0.0, 60.0),
    fixed('sensor.fault_m', 'Size of the jump or drift, m'),
)


AGAIN_S = 0.05
"""Period at which unchanged messages of no tracker are repeated, s."""


class HandTracker(HandoverNode):
    """The replayed hand as a node."""

    NAME = 'hand_tracker'
    PARAMETERS = (
        fixed(
            'source',
            'What is published: a trial or a session as a tracker would see it, or the recorded '
            'poses of a bag',
            choices=('trial', 'session', 'bag'),
        ),
        fixed('bag', 'Bag that is played, if source is bag'),
        fixed('trial', 'CSV file or bag of the trial or session; empty: a synthetic one'),
        fixed(
            'session.lead_s',
            'Part of the recording that is played before the first reach of a session, s',
            0.1,
            3600.0,
        ),
        fixed(
            'session.patience_s',
            'Time for which the partner holds out the hand at an exchange, s',
            0.0,
            3600.0,
        ),
        fixed(
            'cutoff_hz',
            'Cutoff frequency of the low-pass filter of the recording, Hz; 0: no filter',
            0.0,
            100.0,
        ),
        fixed(
            'replay_at_s',
            'Start of the replay, s: in simulated time, or on the wall clock after all nodes are '
            'there; negative: when ~/replay is called',
            -1.0,
            1e9,
        ),
        fixed('lead_s', 'Time from the signal to the start of the replay, s', 0.0, 60.0),
        fixed('rate_hz', 'Rate of the poses, Hz', 1.0, 1000.0),
        fixed(
            'rate_at_rest_hz',
            'Rate at which an unmoved hand is published again, wall clock only, Hz',
            1.0,
            1000.0,
        ),
        TRACKERS,
        TOPIC,
        *SENSOR,
    )
    OF_EACH_TRACKER = (TOPIC, *SENSOR)

    def __init__(self) -> None:
        """Read the recording, show the hand at rest, wait for the start."""
        super().__init__()
        values = self.values
        self._played = _played(values)
        self._messages: list[tuple[Publisher, PoseStamped]] = []
        self._told: dict[Publisher, tuple[list[float], int]] = {}
        self._kept: dict[Publisher, PoseStamped] = {}
        topics = [values[f'{name}.topic'] for name in values['trackers']]
        self._hand_poses = [self.advertise(HAND_POSE, name) for name in topics]
        self._truth = self.advertise(HAND_TRUTH)
        self._demonstrator_pose = self.advertise(DEMONSTRATOR_POSE)
        again_every = max(1, round(values['rate_hz'] * AGAIN_S))
        self._again_every = {self._truth: again_every, self._demonstrator_pose: again_every}
        if values['source'] != 'bag':  # the poses of a bag are published as recorded
            at_rest = max(1, round(values['rate_hz'] / values['rate_at_rest_hz']))
            self._again_every |= dict.fromkeys(self._hand_poses, at_rest)
        self._signal = self.advertise(SIGNAL)
        self.serve('replay', self._replay)
        if values['replay_at_s'] >= 0.0:
            if self.simulated:
                self._begin(values['replay_at_s'])
            else:
                self._awaited = self.every(LOOK_S, self._begin_when_all_are_there)
        if isinstance(self._played, PlayedSession):
            self._listen_for_holder(self._played)
        if self.lockstep:
            periods = Lockstep(self.period_s, self._answer, self._publish)
            self.subscribe(CLOCK, lambda message: periods.ask(nanoseconds(message.clock)))
        else:
            # stamps are whole multiples of the period, so poses are fresh at its ticks
            sleep(self.period_s - self.now_s() % self.period_s)
            self.every(self.period_s, lambda: self._answer(self.now_ns(), 0.0))
        report_condition(self, self._condition)
        what = values['bag'] if values['source'] == 'bag' else values['trial']
        shown = ', '.join(publisher.topic_name for publisher in self._hand_poses)
        self.say(
            f'shows the hand of {what or "a synthetic trial"} on {shown}: replays '
            + ('by itself' if values['replay_at_s'] >= 0.0 else 'when ~/replay is called')
        )

    def _listen_for_holder(self, played: PlayedSession) -> None:
        """Subscribe to the holder of the object or, if none is simulated, to the gripper."""
        told = False

        def hear_holder(message: String) -> None:
            nonlocal told
            told = True
            played.hear(message.data)

        def hear_gripper(message: Bool) -> None:
            if not told:
                played.hear('robot' if message.data else 'partner')

        self.subscribe(OBJECT_HOLDER, hear_holder)
        self.subscribe(GRIPPER_COMMAND, hear_gripper)

    def _replay(self) -> None:
        if not self._signal.get_subscription_count():
            self.get_logger().warning(
                f'nobody subscribes to {self.named(SIGNAL)}: is dmp running?'
            )
        self._begin(self.now_s() + self.values['lead_s'])

    def _begin_when_all_are_there(self) -> None:
        """Start the replay once `dmp` listens and the wrist of the arm is known."""
        listened_to = all(
            publisher.get_subscription_count() for publisher in (*self._hand_poses, self._signal)
        )
        if listened_to and self.count_publishers(self.resolve_topic_name(WRIST_POSE.relative)):
            self._awaited.cancel()
            self._begin(self.now_s() + self.values['replay_at_s'])

    def _begin(self, at_s: float) -> None:
        self._played.start(at_s)
        self.say(f'replays from {at_s:.3f} s')
        self._send_signals()

    def _send_signals(self) -> None:
        for signal_s in self._played.signals():
            time = stamp(round(signal_s * NANOSECONDS))
            self._signal.publish(Header(stamp=time, frame_id=self.frame))
            self.say(f'the signal is for {signal_s:.3f} s')

    def _answer(self, time_ns: int, _elapsed_s: float) -> None:
        self.periods.tick()
        now_s = time_ns / NANOSECONDS
        played = self._played
        streams = [
            *zip(self._hand_poses, played.hands(now_s), strict=False),
            (self._truth, played.truth(now_s)),
            (self._demonstrator_pose, played.demonstrator(now_s)),
        ]
        self._messages = [
            (publisher, self._message(sample, None if number else self._kept.get(publisher)))
            for publisher, samples in streams
            for number, sample in enumerate(samples)
            if self.lockstep or self._is_news(publisher, sample)
        ]
        self._kept |= dict(self._messages)
        self._send_signals()
        self._publish()

    def _is_news(self, publisher: Publisher, sample: HandSample) -> bool:
        """Whether the position has changed, or is due to be repeated."""
        place = sample.position.tolist()
        told, at = self._told.get(publisher, (None, 0))
        if place == told and self.periods.count - at < self._again_every.get(publisher, 0):
            return False
        self._told[publisher] = place, self.periods.count
        return True

    def _message(self, sample: HandSample, older: PoseStamped | None) -> PoseStamped:
        time, frame = stamp(round(sample.stamp_s * NANOSECONDS)), sample.frame or self.frame
        into = older if older is not None and older.header.frame_id == frame else None
        return pose_message(time, sample.position, sample.orientation, frame=frame, into=into)

    def _publish(self) -> None:
        for publisher, message in self._messages:
            publisher.publish(message)

    def _condition(self) -> tuple[str, dict[str, str]]:
        return '', {'replay starts at (s)': f'{self._played.start_s:.3f}'}


def _played(values: Values) -> PlayedTrial | PlayedSession | PlayedBag:
    if values['source'] == 'bag':
        if not values['bag']:
            raise UsageError('hand_tracker: source is bag, but the parameter bag is empty')
        return PlayedBag(values['bag'])
    sensors = [_sensor(name, values) for name in values['trackers']]
    if values['source'] == 'session':
        return PlayedSession(
            recorded_session(values['trial'], cutoff_hz=values['cutoff_hz']),
            sensors,
            tells_lost=values['lockstep'],
            lead_s=values['session.lead_s'],
            patience_s=values['session.patience_s'],
        )
    trial = recorded_trial(values['trial'], cutoff_hz=values['cutoff_hz'])
    return PlayedTrial(trial, sensors, tells_lost=values['lockstep'])


def _sensor(name: str, values: Values) -> SensorModel:
    told = {
        parameter.name.removeprefix('sensor.'): plain(values[f'{name}.{parameter.name}'])
        for parameter in SENSOR
    }
    told['rate_hz'] = told['rate_hz'] or values['rate_hz']
    return SensorModel(**told)


def main() -> int:
    """Run the node."""
    return run(HandTracker)


if __name__ == '__main__':
    sys.exit(main())
