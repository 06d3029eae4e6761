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

"""Node `dmp`: computes the wrist command from the partner's hand, 200 times a second."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from math import inf, isfinite, nan
from pathlib import Path
import sys
from time import monotonic, time_ns

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from handover_dmp.common.quaternions import Quaternion
from handover_dmp.common.settings import parameters_of
from handover_dmp.dmp import DecoupledDmp
from handover_dmp.dmp.parameters import DmpParameters
from handover_dmp.handover.approach import ApproachOptions
from handover_dmp.handover.controller import (
    AFTERWARDS_S,
    HandoverController,
    HandoverOptions,
    HandoverState,
    movement_for,
    MOVING,
    WristCommand,
)
from handover_dmp.handover.recordings import example_model, read_model
from handover_dmp.handover.rehearsal import rehearse
from handover_dmp.handover.release import ReleaseOptions
from handover_dmp.handover.scene_markers import learnt_path
from handover_dmp.handover.session import (
    Leg,
    SessionController,
    SessionModels,
    SessionOptions,
)
from handover_dmp.handover.withdrawal import WithdrawalOptions
from handover_dmp.nodes.conversions import (
    NANOSECONDS,
    nanoseconds,
    orientation_of,
    pose_message,
    pose_with_covariance,
    position_of,
    stamp,
    to_float_array,
    twist_message,
    values_of,
)
from handover_dmp.nodes.diagnostics import of_the_hand, report_condition
from handover_dmp.nodes.gripper import Gripper, OF_GRIPPER
from handover_dmp.nodes.hand_input import HandInputs, HandPose
from handover_dmp.nodes.lockstep import Lockstep
from handover_dmp.nodes.markers import Markers
from handover_dmp.nodes.node import Dated, HandoverNode, MISSED_S
from handover_dmp.nodes.parameters import (
    declare,
    fixed,
    on_change,
    parameters_from,
    Values,
)
from handover_dmp.nodes.spin import run
from handover_dmp.nodes.tracker_parameters import goal_estimator, HAND, ONE_TRACKER
from handover_dmp.nodes.wrench_input import OF_WRENCH, WrenchInput
from handover_dmp.topics import (
    HAND_FUSED,
    IK_STATUS,
    OBJECT_HOLDER,
    PHASE,
    POSE_COMMAND,
    Quality,
    SIGNAL,
    STATE,
    TWIST_COMMAND,
    WRIST_POSE,
)
from handover_dmp.tracking.partner_model import PartnerOptions
from std_msgs.msg import Float64MultiArray, Header, String

MAX_STALL_S = 0.5
"""Gap between two periods, or stall of the process, beyond which the motion ends, s."""
WAKING_PERIODS = 10
"""Periods after a stall that may be late answers to requests made during it."""
MAX_WAKING_GAP_S = 0.05
"""Gap beyond which the motion ends in these first periods after a stall, s."""
MAX_SIGNAL_AGE_S = 5.0
"""Maximum age of a latched signal that is followed, s. Discovery takes less even when busy."""
SIGNALS_REMEMBERED = 16
OVER = (HandoverState.DONE, HandoverState.ABORTED)
PRIMITIVE = parameters_from(
    DmpParameters,
    names=('stiffness', 'damping', 'goal_velocity_gain', 'mu', 'sigma', 'formulation'),
)
SESSION_FIXED = (
    fixed(
        'session.enabled',
        'Whether to run sessions (give, wait, take back, go home) in place of single handovers',
    ),
    fixed('session.take_model', 'File of the learnt take; empty: a synthetic one'),
    fixed(
        'session.holder',
        'Holder of the object when the node starts: robot, partner or auto (as object/holder '
        'says; if it says nothing, the robot, or nobody if the robot picks the object up)',
        choices=('auto', 'robot', 'partner'),
    ),
    *OF_GRIPPER,
    *OF_WRENCH,
)
CHANGEABLE = parameters_from(
    HandoverOptions,
    ApproachOptions,
    PartnerOptions,
    ReleaseOptions,
    SessionOptions,
    WithdrawalOptions,
)


class Dmp(HandoverNode):
    """The movement primitive as a node."""

    NAME = 'dmp'
    PARAMETERS = (
        fixed('model', 'File of the learnt movement; empty: a synthetic one'),
        fixed('rate_hz', 'Rate of the commands, Hz', 10.0, 1000.0),
        fixed(
            'rate_at_rest_hz',
            'Rate of the commands while no handover is active and the wrist stands still, Hz',
            1.0,
            1000.0,
        ),
        fixed(
            'status_rate_at_rest_hz',
            'Rate of handover/phase and hand/fused while no handover is active, Hz',
            0.1,
            1000.0,
        ),
        fixed(
            'exit_when_done',
            'Whether to exit after a handover, with code 0, or 1 if it was aborted',
        ),
        *HAND,
        *CHANGEABLE,
        *SESSION_FIXED,
    )
    OF_EACH_TRACKER = ONE_TRACKER

    def __init__(self) -> None:
        """Load the model, connect the topics, wait for hand and wrist."""
        super().__init__()
        self._made_ns = time_ns()
        path = self.values['model']
        self._learnt = learnt = read_model(Path(path)) if path else example_model()
        self.values |= declare(self, PRIMITIVE, defaults_from=asdict(learnt.parameters))
        self._gripper: Gripper | None = None
        self._wrench: WrenchInput | None = None
        self._wrench_refused = False
        self._overdue = False
        self._controller = self._make_controller()
        on_change(self, CHANGEABLE + PRIMITIVE, self._prepare)
        self._period_ns = round(self.period_s * NANOSECONDS)
        rate_hz = self.values['rate_hz']
        # counted in time, since a busy machine has fewer periods
        self._command_every_s = 1.0 / self.values['rate_at_rest_hz'] - 0.5 * self.period_s
        self._commanded_s = -inf
        self._status_every = max(1, round(rate_hz / self.values['status_rate_at_rest_hz']))
        self._phase_rate = 1.0
        self._phase_rate_ns = -1
        self._lockstep_s = 0.0
        self._orientation: Quaternion | None = None
        self._turned: Quaternion | None = None
        self._wrist_arrival_s = -inf
        self._stepped_s: float | None = None
        self._stepped_monotonic_s = monotonic()
        self._stepped_in_motion = False
        self._since_stall = WAKING_PERIODS
        self._begun_s: float | None = None
        self._signal_s: float | None = None
        # latched signals arrive at both subscriptions
        self._signals_heard: deque[int] = deque(maxlen=SIGNALS_REMEMBERED)
        self._over_s: float | None = None
        self._faults: Counter[str] = Counter()
        self._clock_of_periods = Lockstep(
            self.period_s,
            self._answer,
            self._publish_again,
            patience_s=self.patience_s,
            begun=lambda: self._hands.begun,
            ready=self._ready,
            jumped=self._jumped,
        )
        self._connect()
        self._markers = Markers(self, learnt_path(learnt))
        if not self.lockstep:
            self.every(self.period_s, self._tick)
        report_condition(self, self._condition)
        self.warn_when_in_vain(self._missing)
        self.say(
            f'commands the wrist by {path or "a synthetic example"} in frame {self.frame}; '
            f'listens to {self._hands.named} and {self.named(WRIST_POSE)}'
        )
        self._publish_state()

    def _make_controller(self) -> HandoverController:
        values = self.values
        options, estimator = _options(values), goal_estimator(values)
        model = _movement(self._learnt, options, values)
        if not values['session.enabled']:
            return HandoverController(model, options, estimator)
        take = values['session.take_model']
        self._learnt_take = read_model(Path(take)) if take else example_model(direction='take')
        models = self._session_models(model, options, values)
        controller = SessionController(models, options, estimator, _session_options(values))
        if values['session.holder'] != 'auto':
            controller.begin_with(values['session.holder'])
        return controller

    def _session_models(
        self, give: DecoupledDmp, options: HandoverOptions, values: Values
    ) -> SessionModels:
        """Apply to the take the parameters that differ from those of the learnt give."""
        learnt, default = asdict(self._learnt_take.parameters), asdict(self._learnt.parameters)
        for parameter in PRIMITIVE:
            if values[parameter.name] != default[parameter.name]:
                learnt[parameter.name] = values[parameter.name]
        return SessionModels(give, _movement(self._learnt_take, options, learnt))

    def _connect(self) -> None:
        self._pose_command = self.advertise(POSE_COMMAND)
        self._twist_command = self.advertise(TWIST_COMMAND)
        self._phase = self.advertise(PHASE)
        self._fused = self.advertise(HAND_FUSED)
        self._state = self.advertise(STATE)
        if isinstance(self._controller, SessionController):
            self._gripper = Gripper(self)
            self._wrench = WrenchInput(self, self._clock_of_periods.look, self._refuse_wrench)
        self._pose = self._twist = self._values = self._seen = None
        self._said = ''
        self._commands = self._told = False
        look = self._clock_of_periods.look
        self._hands = HandInputs(self, self._on_hand, self._refuse_hand, look)
        if self._gripper is not None and self.values['session.holder'] == 'auto':
            self.subscribe(OBJECT_HOLDER, self._on_holder)
        self.subscribe(WRIST_POSE, self._on_wrist)
        self.subscribe(IK_STATUS, self._on_ik_status)
        # one subscription for publishers that latch the signal (they may be discovered late),
        # one for those that do not
        self.subscribe(SIGNAL, Dated(self._on_latched_signal))
        self.subscribe(replace(SIGNAL, quality=Quality.COMMAND), Dated(self._on_signal))
        self.serve('start', self._start)
        self.serve('abort', self._controller.abort)
        self.serve('reset', self._controller.reset)

    # Inputs

    def _refuse_hand(self, tracker: str, reason: str, text: str) -> None:
        self._controller.estimator.refuse(reason, tracker)
        self._fault(text)

    def _on_hand(self, hand: HandPose) -> None:
        now_s, pose = self._lockstep_s if self.lockstep else self.now_s(), hand.pose
        reason = self._controller.set_hand(
            hand.stamp_ns / NANOSECONDS,
            pose.position,
            now_s,
            now_s if self.lockstep else self.arrival_s(),
            pose.orientation,
            pose.covariance,
            hand.tracker,
        )
        if reason and reason != 'repeated':
            self._fault(f'hand refused, {reason}')

    def _on_holder(self, message: String) -> None:
        controller = self._controller
        if isinstance(controller, SessionController) and controller.begin_with(message.data):
            first = controller.next_leg.value
            self.say(
                f'{OBJECT_HOLDER.relative} is {message.data}: the session begins with the {first}'
            )
            self._publish_state()

    def _refuse_wrench(self, text: str) -> None:
        self._fault('wrench in an unknown frame: ignored')
        if not self._wrench_refused:
            self._wrench_refused = True
            self.get_logger().warning(text)

    def _on_wrist(self, message: PoseStamped) -> None:
        turned = None
        if self._orientation is None or self._controller.turns or self._wrench is not None:
            turned = orientation_of(message)
        self._controller.set_wrist(position_of(message), turned)
        self._wrist_arrival_s = self.arrival_s()
        self._orientation = self._orientation or turned
        self._turned = turned or self._turned
        if self.lockstep:
            self._clock_of_periods.ask(nanoseconds(message.header.stamp))

    def _on_ik_status(self, message: Float64MultiArray) -> None:
        values = values_of(message)
        scale, time_s = values.get('speed_scale', nan), values.get('time_s', nan)
        if not (0.0 <= scale <= 1.0 and isfinite(time_s)):
            self._fault('invalid status of the inverse kinematics')
            return
        self._phase_rate = scale
        self._phase_rate_ns = round(time_s * NANOSECONDS)
        self._clock_of_periods.look()

    def _on_latched_signal(self, message: Header, published_ns: int) -> None:
        age_s = (time_ns() - published_ns) / NANOSECONDS
        # an unstamped signal has the time of its arrival, which is late after a late discovery
        late = published_ns < self._made_ns or age_s > MAX_SIGNAL_AGE_S
        if late and not self.is_stamped(message.stamp):
            self._fault('signal from before this node started')
            self.get_logger().warning(
                f'ignored a signal from {age_s:.1f} s ago, before this node started; '
                'send it again (play the bag again), or call ~/start'
            )
        else:
            self._on_signal(message, published_ns)

    def _on_signal(self, message: Header, published_ns: int) -> None:
        if published_ns in self._signals_heard:
            return
        self._signals_heard.append(published_ns)
        if self.is_stamped(message.stamp):
            self._signal_s = nanoseconds(message.stamp) / NANOSECONDS
            if self._begun_s is not None:
                self._take_stamped_signal(self._signal_s, self._begun_s)
        else:
            self._take_signal(self.now_s())

    def _take_stamped_signal(self, at_s: float, begun_s: float) -> None:
        # a signal latched before this node started may arrive after its first period
        if at_s >= begun_s:
            self._take_signal(at_s)
        else:
            self._fault('signal from before the first period')
            self.get_logger().warning(
                f'ignored a signal for {at_s:.3f} s, since this node began at {begun_s:.3f} s; '
                'if the stamps are of another clock, as in a '
                'bag that is played, set hand_stamps:=arrival'
            )

    def _take_signal(self, at_s: float) -> None:
        state, start = self._controller.state, self._controller.starts_by
        if start != 'signal':
            self.say(f'ignored a signal, since start is {start}')
        elif state is HandoverState.ABORTED:
            self._fault('signal after an abort')
            self.get_logger().warning('ignored a signal while aborted; call ~/reset or ~/start')
        elif not self._controller.listens:
            self._fault('signal during a handover')
            self.get_logger().warning(f'ignored a signal while {state.value}')
        else:
            self._controller.signal(at_s)
            if self._controller.returns:
                self.say(
                    'signal: going back to the start of the last handover, then the next begins'
                )

    # Services and parameters

    def _start(self) -> str:
        begins = self._controller.start()
        return '' if begins else 'a handover is active, or no wrist pose has been received'

    def _prepare(self, values: Values) -> Callable[[], None]:
        # always from the learnt model: a shape that once had no weight would be lost
        options, controller = _options(values), self._controller
        model = _movement(self._learnt, options, values)
        if isinstance(controller, SessionController):
            models = self._session_models(model, options, values)
            return partial(controller.use_session, models, options, _session_options(values))
        return partial(controller.use, model, options)

    # Periods

    def _ready(self, tick_ns: int) -> bool:
        """Whether the hand of this period and the arm's answer to the last one have arrived."""
        hand = self._hands.are_there(tick_ns, self._controller.options.hand_timeout_s)
        answered_ns = self._clock_of_periods.answered_ns
        followed = answered_ns is None or self._phase_rate_ns >= answered_ns
        # if time moved on without our answer, the arm has not answered either
        missed = answered_ns is not None and tick_ns - answered_ns > 1.5 * self._period_ns
        felt = self._wrench is None or self._wrench.is_there(
            tick_ns, self.values['session.wrench_timeout_s']
        )
        return hand and felt and (followed or missed or self._phase_rate_ns < 0)

    def _answer(self, tick_ns: int, elapsed_s: float) -> None:
        now_s = tick_ns / NANOSECONDS
        self._lockstep_s = now_s
        self._hands.release()
        self._step(now_s, now_s, elapsed_s, tick_ns)

    def _tick(self) -> None:
        now_ns = self.now_ns()
        arrival_s = self.arrival_s()
        last_s = self._stepped_s
        if last_s is not None and arrival_s < last_s:
            self._jumped()
        elapsed_s = 0.0 if last_s is None else min(max(arrival_s - last_s, 0.0), 0.05)
        self._step(now_ns / NANOSECONDS, arrival_s, elapsed_s, now_ns)

    def _step(self, now_s: float, arrival_s: float, elapsed_s: float, time_ns: int) -> None:
        self.periods.tick()
        self._watch_time(now_s, arrival_s)
        self._feel()
        command = self._controller.step(now_s, elapsed_s, self._phase_rate, arrival_s)
        self._stepped_in_motion = self._controller.state in MOVING
        if command is None:
            return
        time = stamp(time_ns)
        active, count = self._stepped_in_motion or self.lockstep, self.periods.count
        moves = any(command.velocity) or any(command.angular_velocity)
        rested = 0.0 <= arrival_s - self._commanded_s < self._command_every_s
        self._commands = active or moves or not rested
        if self._commands:
            self._commanded_s = arrival_s
            self._pose = pose_message(
                time,
                command.position,
                command.orientation or self._orientation,
                frame=self.frame,
                into=self._pose,
            )
            self._twist = twist_message(
                time,
                command.velocity,
                command.angular_velocity,
                frame=self.frame,
                into=self._twist,
            )
        # before what is for observers only: the arm waits for it
        self._publish_command()
        self._told = active or count % self._status_every == 0
        if self._told:
            self._tell(command, now_s, time)
        self._publish_status()
        self._publish_state()
        self._exit_when_done(now_s)
        controller, expectation = self._controller, command.expectation
        self._markers.update(
            time,
            controller.hand,
            controller.wrist,
            controller.exchange_position,
            None if expectation is None else expectation.goal,
        )

    def _feel(self) -> None:
        """Pass the newest force on the wrist to the controller."""
        if self._wrench is None or not isinstance(self._controller, SessionController):
            return
        newest = self._wrench.newest(self._turned)
        if newest is not None:
            self._controller.set_wrench(*newest)

    def _tell(self, command: WristCommand, now_s: float, time: Time) -> None:
        """Prepare the messages that are for observers only, if there are any."""
        # in lockstep they may be sent again, also to observers that have joined since
        if self.lockstep or self._phase.get_subscription_count():
            known = {'hand_stamp_s': self._controller.hand_stamp_s, 'period': self.periods.count}
            numbers = {**command.status_values(now_s), **known}
            self._values = to_float_array(numbers, into=self._values)
        if self.lockstep or self._fused.get_subscription_count():
            hand = self._controller.estimator.estimate(now_s)
            if hand is not None:
                self._seen = pose_with_covariance(
                    time, hand.position, hand.deviation_m, frame=self.frame, into=self._seen
                )

    def _exit_when_done(self, now_s: float) -> None:
        state = self._controller.state
        if not self.values['exit_when_done'] or state not in OVER:
            return
        if self._over_s is None:
            self._over_s = now_s
        elif now_s - self._over_s > AFTERWARDS_S:
            self.exit_code = int(state is not HandoverState.DONE)
            self.ended = True

    def _watch_time(self, now_s: float, arrival_s: float) -> None:
        """End a motion when time jumped or this node stalled; ignore an older signal."""
        last_s, self._stepped_s = self._stepped_s, arrival_s
        stepped_s, self._stepped_monotonic_s = self._stepped_monotonic_s, monotonic()
        stalled = self._stepped_monotonic_s - stepped_s > MAX_STALL_S
        self._since_stall = 0 if stalled and self._stepped_in_motion else self._since_stall + 1
        if last_s is None or arrival_s < last_s:
            self._begun_s = now_s
        if last_s is None:
            if self._signal_s is not None:
                self._take_stamped_signal(self._signal_s, now_s)
            return
        woken = self._since_stall < WAKING_PERIODS
        max_gap_s = MAX_WAKING_GAP_S if woken else MAX_STALL_S
        if 0 <= arrival_s - last_s <= max_gap_s:
            return
        if self._controller.state in MOVING:
            self._fault('time jumped, or this node stalled: aborted')
            self.get_logger().warning(
                f'{arrival_s - last_s:.2f} s between two periods of a motion: aborted'
            )
        elif not (woken and self._controller.state is HandoverState.ABORTED):
            return
        if woken:
            # in each of these periods, since the first wrist poses may be of an arm still braking
            self._controller.hold()
        else:
            self._controller.abort()

    def _publish_again(self) -> None:
        self._publish_command()
        self._publish_status()

    def _publish_command(self) -> None:
        if self._commands and self._pose is not None:
            self._pose_command.publish(self._pose)
            self._twist_command.publish(self._twist)

    def _publish_status(self) -> None:
        if self._told and self._values is not None:
            self._phase.publish(self._values)
        if self._told and self._seen is not None:
            self._fused.publish(self._seen)

    def _publish_state(self) -> None:
        if self._gripper is not None and isinstance(self._controller, SessionController):
            self._gripper.command(self._controller.gripper_closed)
            self._warn_when_overdue(self._controller)
        state = self._controller.state.value
        if state != self._said:
            self._said = state
            self._state.publish(String(data=state))
            self.say(self._in_words(self._controller.state))

    def _warn_when_overdue(self, controller: SessionController) -> None:
        overdue, self._overdue = self._overdue, controller.is_overdue
        if not self._overdue or overdue:
            return
        does = 'take' if controller.leg is Leg.GIVE else 'let go of'
        goes = controller.state is HandoverState.WITHDRAWING
        self.get_logger().warning(
            f'after {controller.session.exchange_timeout_s:g} s of exchange the partner does not '
            f'{does} the object: '
            + ('going home with it' if goes else 'holding on until then, ~/abort or ~/reset')
        )

    def _in_words(self, state: HandoverState) -> str:
        begins = {
            'signal': f'a signal on {self.named(SIGNAL)}',
            'motion': 'a motion of the hand',
            'service': 'a call of ~/start',
        }[self._controller.starts_by]
        return {
            HandoverState.IDLE: f'idle, waiting for {begins}',
            HandoverState.PICKING_UP: 'picking up the object',
            HandoverState.REACHING: 'reaching for the hand',
            HandoverState.EXCHANGE: 'exchange',
            HandoverState.RELEASED: 'released, standing still',
            HandoverState.WITHDRAWING: 'withdrawing',
            HandoverState.WAITING: f'home, waiting for {begins} to take',
            HandoverState.DONE: 'done, holding',
            HandoverState.ABORTED: 'aborted, holding until ~/start or ~/reset',
        }[state]

    def _missing(self) -> str:
        now_s = self.arrival_s()
        if now_s - self._wrist_arrival_s > MISSED_S:
            what, name, who = 'wrist', self.named(WRIST_POSE), 'priority_ik'
        elif self._controller.hand_age_s(now_s) > MISSED_S:
            what, name, who = 'hand', self._hands.named, 'a tracker'
        else:
            return ''
        return f'waiting for poses of the {what} on {name}: is {who} running?'

    def _jumped(self) -> None:
        self._fault('time jumped')
        self._controller.forget_hand()

    # Condition

    def _fault(self, fault: str) -> None:
        self._faults[fault] += 1

    def _condition(self) -> tuple[str, dict[str, str]]:
        faults = [f'{fault} (× {count})' for fault, count in self._faults.items()]
        self._faults.clear()
        now_s = self.arrival_s()
        age_s = self._controller.hand_age_s(now_s)
        if self._overdue:
            faults.append('the exchange takes too long: waiting for the partner')
        if age_s > self._controller.hand_timeout_s:
            faults.append('no recent pose of the hand: braking')
        unchanged_s = self._controller.estimator.unchanged_s
        if self._controller.state in MOVING and unchanged_s > self.values['hand_filter.frozen_s']:
            faults.append('hand unchanged to the last bit: a replay at rest, or a frozen tracker')
        trackers = self._controller.estimator.report(self.now_s())
        faults += [tracker.fault for tracker in trackers]
        if self._gripper is not None:
            faults.append(self._gripper.fault)
        values = {
            'state': self._controller.state.value,
            'age of the hand (s)': f'{age_s:.3f}',
            'age of the wrist (s)': f'{now_s - self._wrist_arrival_s:.3f}',
            **of_the_hand(self._controller.estimator, trackers),
        }
        return '; '.join(filter(None, faults)), values


def _options(values: Values) -> HandoverOptions:
    return HandoverOptions(
        **parameters_of(HandoverOptions, values),
        approach=ApproachOptions(**parameters_of(ApproachOptions, values)),
        partner=PartnerOptions(**parameters_of(PartnerOptions, values)),
    )


def _session_options(values: Values) -> SessionOptions:
    own = parameters_of(SessionOptions, values)
    return SessionOptions(
        **own,
        release=ReleaseOptions(**parameters_of(ReleaseOptions, values)),
        withdrawal=WithdrawalOptions(**parameters_of(WithdrawalOptions, values)),
    )


def _movement(model: DecoupledDmp, options: HandoverOptions, values: Values) -> DecoupledDmp:
    given = {parameter.name: values[parameter.name] for parameter in PRIMITIVE}
    movement = movement_for(model, options, **given)
    rehearse(movement, options)
    return movement


def main() -> int:
    """Run the node."""
    return run(Dmp)


if __name__ == '__main__':
    sys.exit(main())
