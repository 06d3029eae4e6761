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

"""The wrist link of a description: never guessed silently."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from handover_dmp.robot.chain import moving_joints
from handover_dmp.robot.errors import RobotDescriptionError
from handover_dmp.robot.plain_description import ends_of

Element = ElementTree.Element

TOOL_FRAME = re.compile(
    r'(.*[_/-])?(tool\d*|flange|ee|eef|ee_link|ee_frame|tcp|hand_tcp|gripper_tcp|tool_frame|'
    r'tool_link|tool_tip|tool_center_point|end_effector|end_effector_link|endeffector)',
    re.IGNORECASE,
)
"""Usual names of links at the end of an arm; they may have a prefix."""
GRIPPER = re.compile(r'jaw|finger|thumb|grip|claw|knuckle|pinc|tong', re.IGNORECASE)
"""Occurs in the names of the moving parts of a gripper."""
JAW_TRAVEL_M = 0.1
"""A last joint with at most this travel may be the jaw of a gripper, m."""
JAW_EFFORT = 0.06
"""A last joint with at most this share of the greatest effort may be one, too."""
MAX_JOINTS = 7
"""An arm with more joints may have the jaw of a gripper among them."""
MAX_NAMED = 12


def choose_wrist(tree: Element, base_frame: str | None, origin: str) -> tuple[str, str]:
    """
    Find the wrist link if it is not specified.

    It is the only link at the end of moving joints, unless that may be the jaw of a gripper;
    otherwise the only end link with the name of a tool; otherwise the only link with such a name.

    Args:
        tree: root of the description.
        base_frame: first link of the arm; None: the root.
        origin: origin of the description, for error messages.

    Returns:
        Its name, and a remark on the choice; empty if there was none to make.

    Raises:
        RobotDescriptionError: there are several candidates; the error names them.

    """
    links = [link.get('name', '') for link in tree.findall('link')]
    chains = {link: _chain(tree, link, base_frame, origin) for link in links}
    moved = [link for link, chain in chains.items() if chain]
    parents = {ends_of(joint)[0] for joint in tree.findall('joint')}
    ends = [link for link in moved if link not in parents]
    jaws = {end: chains[end][-1] for end in ends if _may_be_jaw(chains[end])}
    if len(ends) == 1 and not jaws:
        return ends[0], ''
    named = [link for link in moved if TOOL_FRAME.fullmatch(link)]
    for tools in ([link for link in named if link in ends], named):
        if len(tools) == 1:
            others = ', '.join(_short([end for end in ends if end != tools[0]], 3))
            return tools[0], (
                f'wrist link: {tools[0]}, chosen by its name (other ends of the arm: {others}; '
                '--wrist-frame or the node parameter wrist_frame selects another)'
            )
    behind = [ends_of(joint)[0] for joint in jaws.values()]
    candidates = list(dict.fromkeys([*named, *behind, *ends]))
    if not candidates:
        raise RobotDescriptionError(f'{origin}: no joint moves any link; is it an arm?')
    why = ''
    if len(ends) == 1:
        joint = jaws[ends[0]].get('name')
        why = f' ({ends[0]!r}, which joint {joint!r} moves, may be the jaw of a gripper)'
    raise RobotDescriptionError(
        f'{origin}: say which link is the wrist{why}, with --wrist-frame or the node parameter '
        f'wrist_frame: {", ".join(_short(candidates, MAX_NAMED))}'
    )


def _chain(tree: Element, link: str, base_frame: str | None, origin: str) -> tuple[Element, ...]:
    """Return the joints that move a link; none if the base does not carry it."""
    try:
        return moving_joints(tree, link, origin, base_frame)
    except RobotDescriptionError:
        return ()


def _may_be_jaw(chain: tuple[Element, ...]) -> bool:
    """Return whether the last joint of a chain may open and close a gripper."""
    last, before = chain[-1], chain[:-1]
    if GRIPPER.search(f'{last.get("name")} {ends_of(last)[1]}') or last.find('mimic') is not None:
        return True
    travel = _limit(last, 'upper') - _limit(last, 'lower')
    if last.get('type') == 'prismatic' and travel < JAW_TRAVEL_M:
        return True
    strongest = max((_limit(joint, 'effort') for joint in before), default=0.0)
    return len(chain) > MAX_JOINTS or 0.0 < _limit(last, 'effort') < JAW_EFFORT * strongest


def _limit(joint: Element, key: str) -> float:
    limit = joint.find('limit')
    return 0.0 if limit is None else float(limit.get(key, 0.0))


def _short(names: list[str], most: int) -> list[str]:
    more = len(names) - most
    return names if more <= 0 else [*names[:most], f'and {more} more']
