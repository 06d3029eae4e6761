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

"""Base class of the nodes: parameters with defaults, topics, services, two clocks."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
import sys
from time import monotonic, time_ns
from typing import Any, ClassVar

from builtin_interfaces.msg import Time
from handover_dmp.common.errors import UsageError
from handover_dmp.nodes.conversions import NANOSECONDS, nanoseconds
from handover_dmp.nodes.once_per_second import OncePerSecond
from handover_dmp.nodes.other_types import other_types
from handover_dmp.nodes.parameters import (
    check_names,
    COMMON,
    declare,
    is_as_it_was,
    Parameter,
)
from handover_dmp.nodes.periods import Periods
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.tracker_parameters import declare_trackers
from handover_dmp.topics import Topic
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_srvs.srv import SetBool, Trigger

NO_EVENTS = SubscriptionEventCallbacks(use_default_callbacks=False)
"""For a subscription that is replaced: an event that waits for a destroyed one ends the node."""
LOOKS_BEFORE_WARNING = 5
"""Looks without success, one per second, after which a node warns."""
LOOKS_IN_VAIN = 15
"""Seconds after which the warning is repeated."""
MISSED_S = 1.0
"""Age at which an input counts as missing, s."""


class HandoverNode(Node):  # type: ignore[misc]
    """
    A node of the graph.

    Attributes:
        NAME: name of the node and of its section in `config/handover.yaml`.
        PARAMETERS: its parameters beyond those of all nodes.
        OF_EACH_TRACKER: its parameters for each of its `trackers`.
        MAKES_TIME: whether the other nodes follow its `/clock` in lockstep.
        period_s: period of its loop, by its parameter `rate_hz` if it has one, s.
        periods: counts and measures these periods.
        ended: set to end the node.
        exit_code: code with which its process then ends.

    """

    NAME: ClassVar[str]
    PARAMETERS: ClassVar[tuple[Parameter, ...]]
    OF_EACH_TRACKER: ClassVar[tuple[Parameter, ...]] = ()
    MAKES_TIME: ClassVar[bool] = False
    ended = False
    exit_code = 0

    def __init__(self) -> None:
        """Declare the parameters; their values at the start are in `self.values`."""
        super().__init__(self.NAME)
        self.values = declare(self, COMMON + self.PARAMETERS)
        if self.OF_EACH_TRACKER:
            self.values |= declare_trackers(self, self.values, self.OF_EACH_TRACKER)
        check_names(self, sys.argv, self.values)
        self.frame: str = self.values['frame']
        self.lockstep: bool = self.values['lockstep']
        self.simulated: bool = self.get_parameter('use_sim_time').value
        if self.lockstep and not (self.simulated or self.MAKES_TIME):
            raise UsageError(f'{self.NAME}: lockstep needs use_sim_time:=true')
        self.add_on_set_parameters_callback(_keep_the_clock)
        self.once_per_second = OncePerSecond(self)
        self.once_per_second.add(other_types(self))
        self.period_s = 1.0 / self.values.get('rate_hz', 1.0)
        self.periods = Periods(self.period_s)

    def say(self, text: str) -> None:
        """
        Log information for the user: the start, a change, the end.

        Args:
            text: one line.

        """
        self.get_logger().info(text)

    def warn_when_in_vain(
        self, missing: Callable[[], str], looks_before: int = LOOKS_BEFORE_WARNING
    ) -> None:
        """
        Warn about missing inputs, after some seconds and then repeatedly.

        Args:
            missing: describes the missing input and its sender; empty while nothing is missing.
            looks_before: looks without success, one per second, after which it warns.

        """
        looks = 0

        def look() -> None:
            nonlocal looks
            text = '' if self.once_per_second.stage == 'end' else missing()
            looks = looks + 1 if text else 0
            if looks % LOOKS_IN_VAIN == looks_before:
                self.get_logger().warning(text)

        self.once_per_second.add(look)

    def say_changes(self, doing: Callable[[], str], fault: Callable[[], str]) -> None:
        """
        Log changes of what a node does, at most once a second.

        Args:
            doing: describes what the node does while there is no fault.
            fault: describes the fault; empty while there is none. It is logged as a warning,
                except before the node first worked.

        """
        last: str | None = None
        was_well = False

        def look() -> None:
            nonlocal last, was_well
            wrong = fault()
            now = wrong or doing()
            if now != last and self.once_per_second.stage == 'running':
                (self.get_logger().warning if wrong and was_well else self.say)(now)
                last = now
            was_well |= not wrong

        self.once_per_second.add(look)

    def named(self, topic: Topic) -> str:
        """
        Return the name of a topic for this node.

        Args:
            topic: which.

        Returns:
            Its absolute name, after all remaps.

        """
        return str(self.resolve_topic_name(topic.relative))

    def set_parameters_atomically(self, parameter_list: list[RosParameter]) -> SetParametersResult:
        """
        Set parameters, all or none; unchanged values are accepted even for fixed parameters.

        The dump of a node can therefore be loaded again.

        Args:
            parameter_list: the requested values.

        Returns:
            Whether they were set; if not, the reason.

        """
        changes = [
            wanted
            for wanted in parameter_list
            if not self.has_parameter(wanted.name)
            or not is_as_it_was(wanted, self.get_parameter(wanted.name))
        ]
        if not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    def finish(self) -> None:
        """Do the last work before the end, while the other nodes can still receive it."""
        self.once_per_second.finish()
        self.say('ends')

    def advertise(self, topic: Topic, name: str = '') -> Publisher:
        """
        Publish a topic.

        Args:
            topic: which.
            name: its name, if it differs from that of `topic`.

        Returns:
            Its publisher.

        Raises:
            UsageError: `name` is no name of a topic.

        """
        kind, name = message_class(topic.type_name), name or topic.relative
        try:
            return self.create_publisher(kind, name, qos_profile(topic.quality))
        except InvalidTopicNameException as error:
            raise _no_topic(name, error) from error

    def subscribe(
        self,
        topic: Topic,
        callback: Callable[[Any], None],
        name: str = '',
        type_name: str = '',
        events: SubscriptionEventCallbacks | None = None,
    ) -> Subscription:
        """
        Subscribe to a topic.

        Args:
            topic: which.
            callback: gets each message.
            name: its name, if it differs from that of `topic`.
            type_name: type of its messages, if it differs from that of `topic`.
            events: `NO_EVENTS` for one that is given to `replace`; default: rclpy warns of
                publishers that do not suit.

        Returns:
            Its subscription.

        Raises:
            UsageError: `name` is no name of a topic.

        """
        kind, name = message_class(type_name or topic.type_name), name or topic.relative
        try:
            return self.create_subscription(
                kind, name, callback, qos_profile(topic.quality), event_callbacks=events
            )
        except InvalidTopicNameException as error:
            raise _no_topic(name, error) from error

    def replace(self, subscription: Subscription, subscribe: Callable[[], object]) -> None:
        """
        Destroy a subscription, and make another as soon as the executor has released it.

        DDS permits one type per topic in a process, and the events executor holds a
        subscription until it next updates its list.

        Args:
            subscription: subscription with `NO_EVENTS`; it hears nothing more.
            subscribe: makes the other one.

        """
        self.destroy_subscription(subscription)
        if self.executor is None:
            subscribe()
        else:
            self.executor.create_task(subscribe)

    def serve(self, name: str, action: Callable[[], str | None]) -> None:
        """
        Offer a service `~/name` of type `std_srvs/Trigger`.

        Args:
            name: name of the service.
            action: does the work; returns the reason if it failed, otherwise nothing or an
                empty string.

        """

        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.message = action() or ''
            response.success = not response.message
            return response

        self.create_service(Trigger, f'~/{name}', answer)

    def serve_switch(self, name: str, switch: Callable[[bool], None]) -> None:
        """
        Offer a service `~/name` of type `std_srvs/SetBool`.

        Args:
            name: name of the service.
            switch: gets the requested value.

        """

        def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            switch(request.data)
            response.success = True
            return response

        self.create_service(SetBool, f'~/{name}', answer)

    def every(self, period_s: float, callback: Callable[[], None], *, wall: bool = False) -> Timer:
        """
        Call a function at a steady rate, and do the housekeeping after it.

        Args:
            period_s: s.
            callback: what to call.
            wall: whether to use the wall clock even if time is simulated.

        Returns:
            The timer.

        """
        steady = wall or not self.simulated
        clock = Clock(clock_type=ClockType.STEADY_TIME) if steady else None

        def period() -> None:
            callback()
            self.once_per_second.period_ended()

        return self.create_timer(period_s, period, clock=clock)

    def patience_s(self) -> float:
        """Return how long to wait for another node in lockstep, s; may change at any time."""
        return float(self.get_parameter('patience_s').value)

    def hand_stamp_ns(self, stamp: Time) -> int:
        """
        Return the time of a message about the hand, by the parameter `hand_stamps`.

        Args:
            stamp: stamp of its header; zero: the present.

        Returns:
            Time on this node's clock, ns.

        """
        return nanoseconds(stamp) if self.is_stamped(stamp) else self.now_ns()

    def is_stamped(self, stamp: Time) -> bool:
        """
        Tell whether a message about the hand has a stamp, by the parameter `hand_stamps`.

        Args:
            stamp: stamp of its header.

        Returns:
            Whether it has; if not, its time is that of its arrival.

        """
        return self.values['hand_stamps'] == 'header' and nanoseconds(stamp) != 0

    def now_ns(self) -> int:
        """Return the current time on the clock of stamps, ns."""
        # same as the clock of rclpy, in a fiftieth of the time
        return int(self.get_clock().now().nanoseconds) if self.simulated else time_ns()

    def now_s(self) -> float:
        """Return the current time on the clock of stamps, s."""
        return self.now_ns() / NANOSECONDS

    def arrival_s(self) -> float:
        """Return the time on the clock of ages, s, which is monotonic unless it is simulated."""
        return self.now_s() if self.simulated else monotonic()


class Dated:
    """A callback of a subscription that also receives when each message was published."""

    # rclpy looks at this
    __signature__ = signature(lambda _message, _info: None)

    def __init__(self, callback: Callable[[Any, int], None]) -> None:
        """
        Wrap a callback.

        Args:
            callback: gets each message and its time of publication, by the sender's clock, ns.

        """
        self._callback = callback

    def __call__(self, *told: Any) -> None:
        """Pass on a message."""
        # the events executor passes both in one tuple
        message, info = told if len(told) == 2 else told[0]
        self._callback(message, info['source_timestamp'])


def _keep_the_clock(requested: list[RosParameter]) -> SetParametersResult:
    if any(parameter.name == 'use_sim_time' for parameter in requested):
        return SetParametersResult(
            successful=False, reason='use_sim_time can only be set at the start'
        )
    return SetParametersResult(successful=True)


def _no_topic(name: str, error: InvalidTopicNameException) -> UsageError:
    reason = str(error).partition('\n')[0].removesuffix(':')
    return UsageError(f'{name!r} is no name of a topic: {reason}')
