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

"""Options of all verbs that choose an arm."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from handover_dmp.robot.descriptions import ArmChoice

WHICH = 'lwr4, iiwa14, panda, ur5, a URDF, or a xacro with its arguments: "FILE.xacro name:=value"'


def add_robot_arguments(parser: argparse.ArgumentParser, default: str) -> None:
    """
    Declare the options that choose an arm.

    Args:
        parser: parser of the verb.
        default: name of the default arm; empty: the arm of the recording.

    """
    more = 'default: %(default)s' if default else 'default: the arm of the recording'
    parser.add_argument('--robot', default=default, help=f'arm: {WHICH} ({more})')
    add_frame_arguments(parser)


def add_frame_arguments(parser: argparse._ActionsContainer) -> None:
    """
    Declare the options that choose a part of a robot.

    Args:
        parser: parser of the verb.

    """
    wrist = 'link that follows the wrist (default: found from the description)'
    base = 'first link of the arm; joints before it do not move (default: the root)'
    parser.add_argument('--wrist-frame', default='', metavar='LINK', help=wrist)
    parser.add_argument('--base-frame', default='', metavar='LINK', help=base)


def chosen_arm(options: argparse.Namespace) -> ArmChoice:
    """
    Return the arm that the options choose.

    Args:
        options: the parsed arguments of `add_robot_arguments`.

    Returns:
        The choice.

    """
    from handover_dmp.robot.descriptions import ArmChoice

    return ArmChoice(options.robot, options.wrist_frame, options.base_frame)
