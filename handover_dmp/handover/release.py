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
Release rule: the giver lets go if the taker carries enough of the weight, or pulls enough.

The measured force on the wrist consists of the object's weight, its inertial force, the bias of
the sensor, and the taker's force. Weight and bias are measured before contact, and the inertial
force follows from the acceleration; the rest is the taker's force. Its component against gravity,
divided by the weight, is the taker's share; its size, without what lifts the object, is the pull.
Both use the median over a short window, so a bump shorter than half of it has no effect.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import dist, hypot, isfinite
from statistics import fmean, median

from handover_dmp.common.arrays import Vector
from handover_dmp.common.errors import UsageError
from handover_dmp.common.settings import dmp_setting
from handover_dmp.common.vectors import plus, scaled_by

GRAVITY = 9.81
"""m/s²."""
WEIGHTLESS_N = 0.1
"""Weight below which the share is undefined, N."""
PARTS = 4
"""Number of parts of the time at rest; their means must agree."""
NOTHING: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ReleaseOptions:
    """
    Conditions under which the giver opens the gripper.

    Raises:
        UsageError: a number is not positive.

    """

    share: float = dmp_setting(
        'release.share',
        'Share of the weight that the taker must carry before the giver opens',
        0.01,
        2.0,
    )
    pull_n: float = dmp_setting(
        'release.pull_n',
        'Force towards the taker that opens the gripper as well, N',
        0.1,
        1000.0,
    )
    contact_n: float = dmp_setting(
        'release.contact_n',
        'Force of the taker below which the object counts as untouched, N',
        0.01,
        100.0,
    )
    window_s: float = dmp_setting(
        'release.window_s',
        'Window of the median filter of the force, s; bumps shorter than half of it are ignored',
        0.005,
        2.0,
    )
    tare_s: float = dmp_setting(
        'release.tare_s',
        'Duration of the force measurement at rest, before the force is judged, s',
        0.01,
        10.0,
    )

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in vars(self).items():
            if not (isfinite(value) and value > 0.0):
                raise UsageError(f'release.{name} is {value}: it must be positive')


class ReleaseRule:
    """
    Decides from the force on the wrist whether the giver lets go.

    Attributes:
        options: the conditions.
        weight_n: weight of the object as given, or as measured at rest, N; 0 before that.

    """

    def __init__(self, options: ReleaseOptions | None = None) -> None:
        """
        Take the rule.

        Args:
            options: the conditions; by default those of `config/`.

        """
        self.options = options or ReleaseOptions()
        self.reset()

    def reset(self, weight_n: float | None = None) -> None:
        """
        Restart, with the wrist at rest and the object held by the gripper alone.

        Args:
            weight_n: weight of the object, N; None: measured.

        Raises:
            UsageError: the weight is negative or not finite.

        """
        if weight_n is not None and not (isfinite(weight_n) and weight_n >= 0.0):
            raise UsageError(
                f'weight of the object is {weight_n} N; it must be finite and not negative'
            )
        self._told_n = weight_n
        self._rest: Vector | None = None
        self.weight_n = weight_n or 0.0
        self._tare: deque[Vector] = deque()
        self._tare_span_s = 0.0
        self._felt: deque[tuple[float, Vector]] = deque()
        self._felt_s = 0.0
        self._silent_s = 0.0
        self._taker = NOTHING

    @property
    def contact(self) -> bool:
        """Whether the taker touches the object."""
        return hypot(*self._taker) > self.options.contact_n

    @property
    def share(self) -> float:
        """
        Share of the weight that the taker carries.

        1 is all of it; it is negative if the taker leans on the object. If the gripper was empty
        at the tare, it is minus the share that the wrist has taken over.
        """
        return self._taker[2] / self.weight_n if self.weight_n > WEIGHTLESS_N else 0.0

    @property
    def pull_n(self) -> float:
        """Force with which the taker pulls in any direction but up, N."""
        x, y, z = self._taker
        return hypot(x, y, min(z, 0.0))

    def update(
        self, force: Sequence[float], dt_s: float, acceleration: Sequence[float] = NOTHING
    ) -> bool:
        """
        Process the force of one period.

        Args:
            force: (3,), force of the held object on the wrist, N, in the axes of `world`. Values
                that are not finite are ignored, and so are exact zeros once the sensor has
                measured a weight.
            dt_s: time since the last call, s.
            acceleration: (3,), acceleration of the wrist, m/s², if known; otherwise the inertial
                force is attributed to the taker.

        Returns:
            Whether to let go.

        """
        if not dt_s >= 0.0:
            return False
        dt_s += self._silent_s
        # after a weight, exact zeros mean that the sensor has failed
        dead = self._rest is not None and any(self._rest) and not any(force)
        if dead or not (all(map(isfinite, force)) and all(map(isfinite, acceleration))):
            self._silent_s = dt_s
            return False
        self._silent_s = 0.0
        if self._rest is None:
            self._measure_rest(force, dt_s, acceleration)
            return False
        inertia = self.weight_n / GRAVITY
        taker = tuple(
            f + inertia * a - r for f, a, r in zip(force, acceleration, self._rest, strict=True)
        )
        if not self._feel(taker, dt_s):
            return False
        carried = self.share > self.options.share
        return self.contact and (carried or self.pull_n > self.options.pull_n)

    def _measure_rest(
        self, force: Sequence[float], dt_s: float, acceleration: Sequence[float]
    ) -> None:
        """Average until all parts of the time agree: otherwise the wrist is not at rest."""
        if self._told_n is None:
            mass = max(0.0, -force[2] / max(GRAVITY + acceleration[2], WEIGHTLESS_N))
        else:
            mass = self._told_n / GRAVITY
        self._tare.append(plus(force, scaled_by(acceleration, mass)))
        self._tare_span_s += dt_s
        if self._tare_span_s < self.options.tare_s or len(self._tare) < PARTS:
            return
        samples, length = list(self._tare), len(self._tare) / PARTS
        rest = _mean(samples)
        for part in range(PARTS):
            first, end = round(part * length), round((part + 1) * length)
            if dist(_mean(samples[first:end]), rest) > 0.5 * self.options.contact_n:
                self._tare.popleft()
                return
        self._rest = rest
        if self._told_n is None:
            self.weight_n = max(0.0, -rest[2])

    def _feel(self, taker: Vector, dt_s: float) -> bool:
        """Update the window and its median; return whether it is full."""
        window_s = self.options.window_s
        if dt_s > 0.5 * window_s:
            # the gap is unknown, and one sample is not a median
            self._felt.clear()
            self._felt_s = 0.0
        elif self._felt:
            self._felt_s += dt_s
        self._felt.append((dt_s, taker))
        while len(self._felt) > 2 and self._felt_s - self._felt[1][0] >= window_s:
            self._felt.popleft()
            self._felt_s -= self._felt[0][0]
        full = self._felt_s >= window_s - 1e-9
        if full:
            forces = [force for _, force in self._felt]
            self._taker = tuple(map(median, zip(*forces, strict=True)))
        return full


def _mean(forces: Sequence[Vector]) -> Vector:
    return tuple(map(fmean, zip(*forces, strict=True)))
