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
The state machine of a handover: idle, reaching, exchange, done, aborted.

One `HandoverController` turns stamped poses of the partner's hand into a wrist command, period by
period. It holds the state of the movement primitive, the goal estimator and the rules for a hand
that is late, wrong or lost. It depends neither on the arm nor on ROS, so the lockstep run and
the `dmp` node use the same class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from functools import lru_cache
from math import dist, hypot, inf, isfinite, nan, sqrt
from typing import Any, NamedTuple

from handover_dmp.common.arrays import Vector
from handover_dmp.common.quaternions import Quaternion
from handover_dmp.common.settings import dmp_setting
from handover_dmp.common.vectors import minus, plus, scaled_by
from handover_dmp.dmp import DecoupledDmp, DmpParameters, DmpState, relearn
from handover_dmp.dmp.orientation import NO_TURN
from handover_dmp.handover.approach import ApproachOptions, bounded, step_towards
from handover_dmp.handover.turning import WristTurning
from handover_dmp.tracking import GoalEstimator, HandEstimate
from handover_dmp.tracking.partner_model import (
    check_partner_model,
    Expectation,
    PARTNER_MODEL,
    PartnerModel,
    PartnerOptions,
)

AFTERWARDS_S = 0.2
"""Time for which a simulated run continues after the end of a handover, s."""


class HandoverState(str, Enum):
    """State of a handover; the values are those of `/handover/state`."""

    IDLE = 'idle'
    PICKING_UP = 'picking_up'
    REACHING = 'reaching'
    EXCHANGE = 'exchange'
    RELEASED = 'released'
    WITHDRAWING = 'withdrawing'
    WAITING = 'waiting'
    DONE = 'done'
    ABORTED = 'aborted'


FOLLOWING = (HandoverState.REACHING, HandoverState.EXCHANGE)
"""States in which the primitive makes the wrist follow the hand."""
MOVING = (
    HandoverState.PICKING_UP,
    *FOLLOWING,
    HandoverState.RELEASED,
    HandoverState.WITHDRAWING,
)
"""States in which a handover, or a session, is in progress."""
RETURN_SPEED = 0.3
"""Speed of the wrist on its return to the start of a handover, m/s."""
RETURN_SHARE = 0.1
"""Share of the acceleration limit for the return."""
RETURNED_M = 0.002
"""Distance of the command from the start at which it has returned, m."""
WRIST_RETURNED_M = 0.02
"""Distance of the wrist from the start at which it has returned, m."""


@dataclass(frozen=True)
class HandoverOptions:
    """
    The rules of a handover.

    Attributes:
        approach: options for a hand that is not where the movement expects it.
        partner: constants of the partner model.

    Raises:
        DataError: `partner_model` is unknown.

    """

    start: str = dmp_setting(
        'start',
        "Trigger of the handover, besides ~/start: signal (the partner's signal), motion (the "
        'hand moves) or service (~/start only)',
        choices=('signal', 'motion', 'service'),
    )
    motion_threshold: float = dmp_setting(
        'motion_threshold',
        'Speed above which the hand counts as moving, m/s',
        0.0,
        5.0,
    )
    hand_timeout_s: float = dmp_setting(
        'hand_timeout_s',
        'Age of the last hand pose, by arrival, beyond which the wrist brakes, s',
        0.01,
        5.0,
    )
    stamp_tolerance_s: float = dmp_setting(
        'stamp_tolerance_s',
        'Maximum difference between the stamp of a hand pose and the current time, s',
        0.01,
        60.0,
    )
    exchange_distance_m: float = dmp_setting(
        'exchange_distance_m',
        'Distance from wrist to goal below which the exchange may begin, m',
        0.001,
        1.0,
    )
    exchange_speed: float = dmp_setting(
        'exchange_speed',
        'Speed of the wrist relative to the goal below which the exchange may begin, m/s',
        0.001,
        5.0,
    )
    exchange_hold_s: float = dmp_setting(
        'exchange_hold_s', 'Duration of the exchange, s', 0.0, 60.0
    )
    acceleration_limit: float = dmp_setting(
        'acceleration_limit',
        'Maximum acceleration of the wrist command, m/s²',
        0.1,
        1000.0,
    )
    tracking_error_limit_m: float = dmp_setting(
        'tracking_error_limit_m',
        'Maximum distance of the command ahead of the measured wrist, m',
        0.001,
        10.0,
    )
    phase_stopping: bool = dmp_setting(
        'phase_stopping', 'Whether the phase slows down for an arm that cannot keep up'
    )
    approach: ApproachOptions = field(default_factory=ApproachOptions)
    partner_model: str = dmp_setting(
        'partner_model',
        'Use of the partner model: auto (if the learnt movement has one) or off',
        choices=PARTNER_MODEL,
    )
    partner: PartnerOptions = field(default_factory=PartnerOptions)

    def __post_init__(self) -> None:
        """Check `partner_model`."""
        check_partner_model(self.partner_model)

    def expects_of(self, model: DecoupledDmp) -> bool:
        """
        Return whether the partner model is used.

        Args:
            model: the movement.

        Returns:
            Whether it is enabled, and the movement has a partner path.

        """
        return self.partner_model == 'auto' and model.partner_path is not None


def movement_for(model: DecoupledDmp, options: HandoverOptions, **changes: Any) -> DecoupledDmp:
    """
    Return the movement that is run under given options.

    Args:
        model: the learnt movement.
        options: the rules; the partner model brings its own goal weight.
        changes: fields of `DmpParameters` that replace the learnt ones.

    Returns:
        The movement with these parameters; `model` itself if nothing changes.

    Raises:
        DataError: a parameter is out of its range.

    """
    if options.expects_of(model):
        changes |= {'mu': options.partner.mu, 'sigma': options.partner.sigma}
    return _relearnt(model, replace(model.parameters, **changes))


@lru_cache(maxsize=4)
def _relearnt(model: DecoupledDmp, parameters: DmpParameters) -> DecoupledDmp:
    """Relearn once and keep the result; relearning again could change the last bits."""
    return relearn(model, **asdict(parameters))


class WristCommand(NamedTuple):
    """
    The wrist command of one period.

    Attributes:
        position: m, in `world`.
        velocity: m/s.
        state: state of the handover.
        phase: s of (4), 1 at the start, towards 0.
        goal_weight: w_g of (8).
        hand_age_s: time since the last accepted pose of the hand arrived, s; infinite before any.
        phase_rate: speed of the phase; 0 while the wrist brakes or holds.
        expectation: output of the partner model; None without it, or without a hand to follow.
        orientation: quaternion x, y, z, w, in `world`; None if the movement has learnt none.
        angular_velocity: rad/s.

    """

    position: Vector
    velocity: Vector
    state: HandoverState
    phase: float
    goal_weight: float
    hand_age_s: float
    phase_rate: float = 0.0
    expectation: Expectation | None = None
    orientation: Quaternion | None = None
    angular_velocity: Vector = NO_TURN

    def status_values(self, time_s: float) -> dict[str, float]:
        """
        Return the values of `/handover/phase`.

        Args:
            time_s: time of the period, s.

        Returns:
            Name to value.

        """
        return {
            'time_s': time_s,
            'phase': self.phase,
            'goal_weight': self.goal_weight,
            'hand_age_s': self.hand_age_s,
            'phase_rate': self.phase_rate,
            'trust': 0.0 if self.expectation is None else self.expectation.trust,
            'lead': 0.0 if self.expectation is None else self.expectation.lead,
        }


class HandoverController:
    """
    Moves the wrist towards a moving hand by (8), and determines the exchange.

    All times are of one clock of the caller, in s. The age of the hand is judged by arrival times,
    not by stamps.

    Attributes:
        model: the movement in use.
        options: the rules.
        estimator: estimator of the hand's position and velocity.
        hand: last seen position of the hand, fused from all trackers, m; None if unknown.
        hand_stamp_s: time of the newest accepted pose of the hand, s; NaN before one.
        wrist: measured position of the wrist, m; None if unknown.
        returns: whether the wrist is returning to the start of the last handover.

    """

    def __init__(
        self,
        model: DecoupledDmp,
        options: HandoverOptions | None = None,
        estimator: GoalEstimator | None = None,
    ) -> None:
        """
        Take the learnt movement and the rules.

        Args:
            model: the primitive, with the goal offset of its reference.
            options: the rules; the defaults of `config/` if left out.
            estimator: estimator of the hand's position and velocity.

        """
        self._partner: PartnerModel | None = None
        self._turning = WristTurning()
        self.use(model, options or HandoverOptions())
        self.estimator = estimator or GoalEstimator()
        self.wrist: Vector | None = None
        self._primitive: DmpState | None = None
        self._begun_at: Vector | None = None
        self.reset()

    def use(self, model: DecoupledDmp, options: HandoverOptions) -> None:
        """
        Change movement and rules from the next period on; the partner model from the next start.

        Args:
            model: the learnt movement.
            options: the rules.

        """
        self.options = options
        self.model = movement_for(model, options)
        self._turning.use(self.model)
        if not options.expects_of(model):
            self._partner = None

    def reset(self) -> None:
        """Forget the handover and the hand; brake if necessary, then hold the wrist."""
        self.state = HandoverState.IDLE
        self.forget_hand()
        self._begin_anew()
        self._goal_weight = 0.0
        self._phase_rate = 0.0
        self._expectation: Expectation | None = None
        if self._primitive is not None and not any(self._primitive.velocity):
            self._primitive = None

    def hand_age_s(self, arrival_s: float) -> float:
        """
        Return the age of the hand: the time since its last accepted pose arrived.

        Args:
            arrival_s: the present time, s, on the clock of the arrivals.

        Returns:
            The age, s; infinite before any pose.

        """
        return max(0.0, arrival_s - self._hand_arrival_s)

    def forget_hand(self) -> None:
        """Forget the hand, e.g. after a jump in time; the wrist brakes until it is seen again."""
        self.estimator.reset()
        self.hand: Vector | None = None
        self.hand_stamp_s = nan
        self._hand_arrival_s = -inf

    @property
    def hand_timeout_s(self) -> float:
        """Age of the hand beyond which the wrist brakes, s; larger for a slow tracker."""
        return max(self.options.hand_timeout_s, self.estimator.timeout_s)

    def set_hand(
        self,
        stamp_s: float,
        position: Vector,
        now_s: float,
        arrival_s: float,
        orientation: Sequence[float] | None = None,
        covariance: Sequence[float] | None = None,
        tracker: str = '',
    ) -> str:
        """
        Process a pose of the partner's hand.

        Args:
            stamp_s: time of the measurement, s.
            position: (3,), m, in `world`.
            now_s: the time, s, on the clock of the stamps.
            arrival_s: the time, s, on the clock of the arrivals.
            orientation: quaternion x, y, z, w, if known; norm 0 marks an invalid pose.
            covariance: (36,), if known; −1 marks an invalid pose.
            tracker: name of its tracker; the first one if left out.

        Returns:
            The reason why it was refused, one word; empty if it was used.

        """
        # also if it is not a number
        if not abs(stamp_s - now_s) <= self.options.stamp_tolerance_s:
            self.estimator.refuse('other_time', tracker)
            return 'other_time'
        reason = self.estimator.update(stamp_s, position, now_s, orientation, covariance, tracker)
        if reason:
            return reason
        seen = self.estimator.estimate(stamp_s)
        self.hand = None if seen is None else seen.position
        self.hand_stamp_s = stamp_s
        self._hand_arrival_s = arrival_s
        return ''

    def set_wrist(self, position: Vector, orientation: Quaternion | None = None) -> None:
        """
        Process the measured pose of the robot's wrist.

        Args:
            position: (3,), m, in `world`.
            orientation: unit quaternion x, y, z, w; needed if `turns`.

        """
        if all(map(isfinite, position)):
            self.wrist = position
        if orientation is not None and all(map(isfinite, orientation)):
            self._turning.measure(orientation)

    @property
    def turns(self) -> bool:
        """Whether the movement has learnt the orientation of the wrist, so it is commanded."""
        return self._turning.is_learnt

    def signal(self, at_s: float) -> None:
        """
        Process the partner's signal: the handover starts at a given time.

        After a completed handover, the wrist first returns to its start.

        Args:
            at_s: time of the start, s; a time in the past means now.

        """
        if self.options.start != 'signal':
            return
        if self.state is HandoverState.DONE:
            self.reset()
            self.returns = self._begun_at is not None
        self._signal_s = at_s

    @property
    def starts_by(self) -> str:
        """Return what starts the next handover: `signal`, `motion` or `service`."""
        return self.options.start

    @property
    def listens(self) -> bool:
        """Whether a signal is followed now, or as soon as the wrist has returned."""
        return self.state not in (*MOVING, HandoverState.ABORTED)

    def start(self) -> bool:
        """
        Start reaching from the present wrist position.

        Returns:
            Whether it started; not during a handover, nor before the wrist is known.

        """
        if self.state in MOVING or self.wrist is None:
            return False
        if self._primitive is None:
            self._primitive = self.model.initial_state(self.wrist)
        else:
            held = self._anchored(self._primitive)
            self._primitive = self.model.initial_state(held.position, held.velocity)
        self._begun_at = self.wrist
        self._begin_anew()
        self._goal_weight = float(self.model.goal_weight(self._primitive.phase))
        self._turning.use(self.model)
        self._turning.start()
        expecting = self.options.expects_of(self.model)
        self._partner = PartnerModel(self.model, self.options.partner) if expecting else None
        self.state = HandoverState.REACHING
        return True

    def _begin_anew(self) -> None:
        self.exchange_position: Vector | None = None
        self._exchange_since_s = nan
        self._signal_s = inf
        self._astray = -inf
        self.returns = False

    def abort(self) -> None:
        """Brake and hold until `start` or `reset`."""
        self.state = HandoverState.ABORTED
        self.returns = False

    def hold(self) -> None:
        """Abort at the wrist's position: commands were missing so long that the arm stands."""
        self.abort()
        self._primitive = None
        self._turning.forget()

    def step(
        self, now_s: float, dt: float, phase_rate: float = 1.0, arrival_s: float | None = None
    ) -> WristCommand | None:
        """
        Advance by one period.

        Args:
            now_s: the time at the start of the period, s, on the clock of the stamps.
            dt: its length, s.
            phase_rate: maximum speed of the phase, 0 to 1; below 1 if the arm cannot keep up.
            arrival_s: the same time on the clock of the arrivals, if that differs.

        Returns:
            The command for the end of the period; None until the wrist is known.

        """
        if self.wrist is None:
            return None
        if self._primitive is None:
            self._primitive = self.model.initial_state(self.wrist)
        hand = self.estimator.estimate(now_s)
        age = self.hand_age_s(now_s if arrival_s is None else arrival_s)
        self._start_if_signalled(now_s, hand)
        fresh = hand is not None and age <= self.hand_timeout_s
        if self.state in FOLLOWING and hand is not None and fresh:
            rate = phase_rate if self.options.phase_stopping else 1.0
            self._primitive = self._follow(self._primitive, hand, dt, rate)
            self._judge_exchange(now_s, hand)
        else:
            if self.state in FOLLOWING and self._partner is not None:
                self._partner.wait(dt)
            self._phase_rate, self._expectation = 0.0, None
            returns = self.returns and fresh
            move = self._go_back if returns else self._brake
            self._primitive = move(self._primitive, dt)
            self._turning.rest(dt, back=returns)
        return self._command(self._primitive, age)

    def _start_if_signalled(self, now_s: float, hand: HandEstimate | None) -> None:
        if self.state is not HandoverState.IDLE or hand is None or self.returns:
            return
        signalled = now_s >= self._signal_s
        moving = (
            self.options.start == 'motion'
            and hypot(*hand.velocity) > self.options.motion_threshold
        )
        if signalled or moving:
            self.start()

    def _goal(self, hand: HandEstimate) -> Vector:
        # plain floats: the primitive's step takes several times as long with NumPy's
        return plus(hand.position, self.model.goal_offset.tolist())

    def _follow(
        self, primitive: DmpState, hand: HandEstimate, dt: float, phase_rate: float
    ) -> DmpState:
        goal, goal_velocity = self._goal(hand), tuple(map(float, hand.velocity))
        options, limit = self.options.approach, self.options.acceleration_limit
        primitive = self._anchored(primitive)
        expected = self._expectation = None
        if self._partner is not None:
            place: Vector = tuple(map(float, hand.position))
            self._expectation = self._partner.expect(
                place, goal_velocity, primitive, dt, phase_rate
            )
            expected = self._expectation.goal, self._expectation.goal_velocity
            phase_rate *= self._expectation.phase_rate
        self._phase_rate = phase_rate
        ahead, self._goal_weight, self._astray = step_towards(
            self.model,
            primitive,
            goal,
            goal_velocity,
            dt,
            phase_rate,
            options,
            self._astray,
            expected,
        )
        self._turning.follow(dt, phase_rate, self._goal_weight)
        return bounded(primitive, ahead, goal, goal_velocity, dt, limit, options)

    def _anchored(self, primitive: DmpState) -> DmpState:
        """Keep the command near the measured wrist, so that it cannot wind up."""
        assert self.wrist is not None
        distance = dist(primitive.position, self.wrist)
        if distance <= self.options.tracking_error_limit_m:
            return primitive
        share = self.options.tracking_error_limit_m / distance
        ahead = minus(primitive.position, self.wrist)
        return primitive._replace(position=plus(self.wrist, scaled_by(ahead, share)))

    def _brake(self, primitive: DmpState, dt: float) -> DmpState:
        """Brake; at rest hold the position, or the present one if something moved the wrist."""
        assert self.wrist is not None
        if any(primitive.velocity):
            return primitive.braked(dt, self.options.acceleration_limit)
        if dist(primitive.position, self.wrist) > self.options.tracking_error_limit_m:
            return primitive._replace(position=self.wrist)
        return primitive

    def _go_back(self, primitive: DmpState, dt: float) -> DmpState:
        """Move straight to the start of the last handover, and stop there."""
        assert self.wrist is not None and self._begun_at is not None
        primitive = self._anchored(primitive)
        left = dist(primitive.position, self._begun_at)
        if left < RETURNED_M:
            self.returns = dist(self.wrist, self._begun_at) > WRIST_RETURNED_M
            return self._brake(primitive, dt)
        limit = RETURN_SHARE * self.options.acceleration_limit
        speed = min(RETURN_SPEED, sqrt(limit * left))
        way = minus(self._begun_at, primitive.position)
        wanted = tuple(speed * part / left for part in way)
        return primitive.accelerated(minus(wanted, primitive.velocity), dt, limit)

    def _judge_exchange(self, now_s: float, hand: HandEstimate) -> None:
        assert self.wrist is not None and self._primitive is not None
        if self.state is HandoverState.EXCHANGE:
            if now_s - self._exchange_since_s >= self.options.exchange_hold_s:
                self.state = HandoverState.DONE
            return
        if self._is_at(hand) and self._goal_weight > 0.5:
            self.state = HandoverState.EXCHANGE
            self.exchange_position = self.wrist
            self._exchange_since_s = now_s

    def _is_at(self, hand: HandEstimate) -> bool:
        """Return whether the wrist is close enough to the goal, and as fast as the hand."""
        assert self.wrist is not None and self._primitive is not None
        gap = dist(self.wrist, self._goal(hand))
        relative = dist(self._primitive.velocity, hand.velocity)
        return gap < self.options.exchange_distance_m and relative < self.options.exchange_speed

    def _command(self, primitive: DmpState, age: float) -> WristCommand:
        return WristCommand(
            position=primitive.position,
            velocity=primitive.velocity,
            state=self.state,
            phase=primitive.phase,
            goal_weight=self._goal_weight,
            hand_age_s=age,
            phase_rate=self._phase_rate,
            expectation=self._expectation,
            orientation=self._turning.orientation,
            angular_velocity=self._turning.angular_velocity,
        )
