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

"""How processes leave DDS: one after the other, since Fast DDS can hang if two leave at once."""

from __future__ import annotations

from contextlib import ExitStack, suppress
import fcntl
import os
from pathlib import Path
from tempfile import gettempdir
from time import monotonic, sleep
from typing import TextIO

import rclpy
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node

SETTLE_S = 0.05
MAX_WAIT_S = 4.0
MAX_DELIVERY_S = 0.2
LOOK_S = 0.01


def shut_down(node: Node, *, or_not: bool = False) -> bool:
    """
    Destroy the last node of a process and shut down its context, while no neighbour does so.

    Fast DDS 2.14, as built for the Python package index, never returns from the destruction of
    a participant that is being notified of a neighbour's end: the wait for that callback
    (`DomainParticipantImpl::set_listener`) has a deadline that overflows, so it fails at once, is
    repeated, and the mutex that the callback needs is never free. Ctrl-C ends all nodes of a
    graph together, so they take turns, and each waits until the end of the last one is known.

    Args:
        node: the node, which is no longer spun.
        or_not: whether to leave everything as it is if the turn does not come, as on a busy
            machine; if not, it proceeds without.

    Returns:
        Whether it was done.

    """
    # the last messages must arrive before the turn, since others wait for it
    _deliver(node)
    with ExitStack() as turn:
        with suppress(OSError):
            file = turn_file(node.context.get_domain_id()).open('w')
            if not _has(turn.enter_context(file)) and or_not:
                return False
        sleep(SETTLE_S)
        node.destroy_node()
        end_context(node.context)
    return True


def end_context(context: Context) -> None:
    """
    Shut down a context, so that the process may start another one.

    Args:
        context: the default one or another; the rest stay alive.

    """
    # the default context is only replaced if none is named
    own = context is not rclpy.utilities.get_default_context()
    rclpy.try_shutdown(context=context if own else None)


def _deliver(node: Node) -> None:
    """Wait until the last messages have arrived; they may be lost with their sender."""
    deadline_s = monotonic() + MAX_DELIVERY_S
    for publisher in node.publishers:
        left_s = max(0.0, deadline_s - monotonic())
        publisher.wait_for_all_acked(Duration(seconds=left_s))


def turn_file(domain: int) -> Path:
    """
    Return the file whose lock is the turn to leave.

    Args:
        domain: domain of DDS.

    Returns:
        The file, which belongs to this user.

    """
    return Path(gettempdir()) / f'handover_dmp_{os.getuid()}_leaving_{domain}.lock'


def _has(file: TextIO) -> bool:
    """Lock a file, or give up if it stays locked; return whether it is locked."""
    deadline_s = monotonic() + MAX_WAIT_S
    while monotonic() < deadline_s:
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        sleep(LOOK_S)
    return False
