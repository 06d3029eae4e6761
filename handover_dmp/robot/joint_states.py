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

"""Extraction of the arm's joints from the joint states of a driver, with their faults."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, isnan

from handover_dmp.common.arrays import Array
from handover_dmp.robot.model import RobotModel
import numpy as np
from numpy.typing import ArrayLike

SHOWN = 3
"""Maximum number of joint names in a message."""


class JointStateReader:
    """Finds the joints of an arm in joint states of any order, which may contain other joints."""

    def __init__(self, joint_names: Sequence[str], prefix: str = '') -> None:
        """
        Take the names.

        Args:
            joint_names: joints of the arm, in the model's order.
            prefix: prefix of the driver's joint names.

        """
        self._wanted = tuple(joint_names)
        self._prefix = prefix
        self._names = tuple(prefix + name for name in joint_names)
        self._order: tuple[tuple[str, ...] | None, list[int]] = (None, [])

    def concerns(self, names: Sequence[str]) -> bool:
        """
        Return whether joint states are of this arm, and not of a gripper or another arm.

        Args:
            names: names of the joints.

        Returns:
            Whether one of the arm's joints is among them.

        """
        return tuple(names) == self._order[0] or not set(self._names).isdisjoint(names)

    def read(
        self, names: Sequence[str], positions: ArrayLike, velocities: ArrayLike
    ) -> tuple[Array, Array | None] | str:
        """
        Extract the arm's joints.

        Args:
            names: names of the joints.
            positions: rad, one per name.
            velocities: rad/s, one per name or none at all; NaN if they are not measured.

        Returns:
            Positions, (n,), rad, and velocities, (n,), rad/s, or None if there are none, in the
            model's order; otherwise the fault.

        """
        measured, moving = np.asarray(positions, float), np.asarray(velocities, float)
        fault = self._fault(names, measured, moving)
        if fault:
            return fault
        order = self._order[1]
        if not len(moving) or any(map(isnan, moving[order].tolist())):
            return measured[order], None
        if not all_finite(moving[order]):
            return 'joint velocities are not finite'
        return measured[order], moving[order]

    def _fault(self, names: Sequence[str], positions: Array, velocities: Array) -> str:
        if tuple(names) != self._order[0]:
            missing = [name for name in self._names if name not in names]
            if len(missing) == len(self._names):
                return self._strangers(names)
            if missing:
                return f'joint states lack {", ".join(missing)}'
            if len(set(names)) != len(names):
                return 'joint states name a joint twice'
            index = {name: i for i, name in enumerate(names)}
            self._order = (tuple(names), [index[name] for name in self._names])
        if len(positions) != len(names):
            return f'joint states have {len(names)} names, but {len(positions)} positions'
        if len(velocities) not in (0, len(names)):
            return (
                f'joint states: velocity has {len(velocities)} values, position {len(positions)}'
            )
        return '' if all_finite(positions[self._order[1]]) else 'joint positions are not finite'

    def _strangers(self, names: Sequence[str]) -> str:
        """Describe the received and expected names, and how to make them match."""
        fault = f'joint states name {_shown(names)}; expected {_shown(self._names)}'
        first = self._wanted[0]
        for prefix in [name.removesuffix(first) for name in names if name.endswith(first)]:
            if {prefix + name for name in self._wanted} <= set(names):
                return f'{fault}: set joint_prefix to {prefix!r}'
        return fault


class MeasuredArm:
    """
    Base of what controls an arm by its joint states, which may be wrong or late.

    Attributes:
        model: the arm.
        joint_states: finds its joints.

    """

    def __init__(self, model: RobotModel, joint_prefix: str) -> None:
        self.model = model
        self.joint_states = JointStateReader(model.joint_names, joint_prefix)
        self._forget_joint_states()

    def _forget_joint_states(self) -> None:
        self._positions: Array | None = None
        self._measured_velocities = np.zeros(self.model.dof)
        self._joint_fault = 'no joint states yet'
        self._joint_arrival_s = float('-inf')

    def set_joint_state(
        self,
        names: Sequence[str],
        positions: ArrayLike,
        velocities: ArrayLike,
        arrival_s: float,
    ) -> bool:
        """
        Process measured joint states, in any order, possibly with other joints.

        Args:
            names: names of the joints.
            positions: rad, one per name.
            velocities: rad/s, one per name or none at all; NaN if not measured.
            arrival_s: time of arrival, s.

        Returns:
            Whether they were used.

        """
        found = self.joint_states.read(names, positions, velocities)
        if isinstance(found, str):
            # ignore those of a gripper or another arm, once this arm's have arrived
            if self._positions is None or self.joint_states.concerns(names):
                self._joint_fault = found
            return False
        self._joint_fault = ''
        self._positions, measured_velocities = found
        if measured_velocities is not None:
            self._measured_velocities = measured_velocities
        self._joint_arrival_s = arrival_s
        return True

    def _joint_state_fault(self, now_s: float, timeout_s: float) -> str:
        """Return the fault of the joint states; empty if there is none."""
        age_s = now_s - self._joint_arrival_s
        if not self._joint_fault and age_s > timeout_s:
            return f'joint states are {age_s:.3f} s old'
        return self._joint_fault

    @property
    def _measured(self) -> Array:
        assert self._positions is not None
        return self._positions


def _shown(names: Sequence[str]) -> str:
    return ', '.join(names[:SHOWN]) + (', …' if len(names) > SHOWN else '') if names else 'nothing'


def all_finite(values: Array) -> bool:
    """
    Return whether every number of an array is finite.

    Args:
        values: a few numbers; for these it is several times as fast as `numpy.isfinite`.

    Returns:
        Whether all are finite.

    """
    return all(map(isfinite, values.ravel().tolist()))
