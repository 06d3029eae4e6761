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

"""Life cycle of every node: start, spin, clean end by SIGINT or SIGTERM."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
import faulthandler
from functools import partial
import gc
import os
from pathlib import Path
import signal
import sys

from handover_dmp.common.errors import HandoverError, UsageError
from handover_dmp.nodes.once_per_second import OncePerSecond
from handover_dmp.nodes.shutdown import shut_down
import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

PARENT_VARIABLE = 'HANDOVER_DMP_PARENT'
POLL_S = 0.05
MAX_END_S = 15.0
STDERR = 2
MAX_PRIORITY = 99
_ended: list[int] = []
"""Signals that told this process to end."""


def run(make_node: Callable[[], Node], arguments: Sequence[str] | None = None) -> int:
    """
    Run a node until it is told to end; visible on this machine only, unless ROS is configured.

    The executor returns regularly, since the events executor of these wheels does not
    check signals. Python's garbage collection runs with the other housekeeping, once a second
    between two periods.
    On the wall clock it runs at the real-time priority of its parameter `thread_priority`, if that
    is above 0, as the controller manager of ros2_control does.

    Args:
        make_node: makes the node; a `HandoverError` there ends the process with its one line.
            A node ends itself by setting `ended`. Its `finish`, if it has one, is called before
            it takes its turn to leave; it must end the jobs that run once a second.
        arguments: ROS arguments; default: those of the process.

    Returns:
        Exit code: 0 after SIGINT or SIGTERM, or the node's own `exit_code`.

    """
    _ended.clear()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        # without what rcl says of itself, and of where in its source
        reason = str(error).removeprefix('failed to initialize rcl: ').partition(', at /')[0]
        what = 'unknown ROS arguments' if reason.startswith('[') else 'ROS arguments'
        print(f'{what}: {reason}', file=sys.stderr)
        return UsageError.exit_code
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda caught, _frame: _ended.append(caught))
    try:
        node = make_node()
        executor, spin = _executor(node)
    except HandoverError as error:
        print(error, file=sys.stderr)
        rclpy.try_shutdown()
        return error.exit_code
    _prioritise(node)
    gc.collect()
    gc.freeze()
    gc.disable()
    once_per_second = getattr(node, 'once_per_second', None) or OncePerSecond(node)
    once_per_second.add(lambda: gc.collect(1))
    try:
        once_per_second.start()
        while not told_to_end() and rclpy.ok() and not getattr(node, 'ended', False):
            spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        # a process that hangs in DDS is ended here, with a traceback
        faulthandler.dump_traceback_later(MAX_END_S, exit=True, file=STDERR)
        getattr(node, 'finish', once_per_second.finish)()
        executor.shutdown()
        exit_code = int(getattr(node, 'exit_code', 0))
        if not shut_down(node, or_not=sys.exc_info()[0] is None):
            # everything is sent and written; leaving DDS out of turn may never return
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(exit_code)
        # what is left cannot hang, but takes long where a machine has no time
        faulthandler.cancel_dump_traceback_later()
    # Extension modules complain at exit about remaining objects.
    del node, executor
    gc.unfreeze()
    gc.collect()
    return exit_code


def told_to_end() -> bool:
    """
    Tell whether the node shall end, for nodes that wait for something before they are spun.

    Returns:
        Whether a signal has arrived, or the parent process is gone.

    """
    return bool(_ended) or _orphaned()


def events_executor(context: Context | None = None) -> Executor | None:
    """
    Make an executor that takes half the processor time of the default one.

    Args:
        context: context of its nodes; default: that of the process.

    Returns:
        The executor, or None where rclpy is older than 7.1.4.

    """
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return None
    return EventsExecutor(context=context)


def _executor(node: Node) -> tuple[Executor, Callable[[], None]]:
    """Make the executor of the node, and a function that spins it for at most `POLL_S`."""
    default = node.has_parameter('executor') and node.get_parameter('executor').value == 'default'
    executor = SingleThreadedExecutor() if default else events_executor()
    if executor is None:
        raise UsageError(
            'executor is events, for which this rclpy is too old; update it, or set '
            'executor:=default'
        )
    executor.add_node(node)
    if default:
        return executor, partial(executor.spin_once, POLL_S)
    # many events at once, since nothing has to be checked after each
    return executor, partial(executor.spin_until_future_complete, Future(), POLL_S)


def _prioritise(node: Node) -> None:
    """
    Give all threads of this process the real-time priority of the node.

    Only if the system permits it, and never in lockstep, in which nodes use all processor time.
    """
    if not node.has_parameter('thread_priority') or getattr(node, 'lockstep', False):
        return
    priority = int(node.get_parameter('thread_priority').value)
    if priority > 0:
        for thread in (int(path.name) for path in Path('/proc/self/task').iterdir()):
            # threads of the middleware do discovery and services: Python must not starve them
            own = priority if thread == os.getpid() else min(priority + 1, MAX_PRIORITY)
            with suppress(PermissionError, ProcessLookupError):
                os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(own))


def _orphaned() -> bool:
    """Whether the parent process, which this one must not outlive, is gone."""
    parent = os.environ.get(PARENT_VARIABLE)
    return parent is not None and os.getppid() != int(parent)
