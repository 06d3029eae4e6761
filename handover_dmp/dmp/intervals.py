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
The transformation system between the samples of a rollout, as a linear recursion.

With z = (x − x0, ẋ) it reads z_{k+1} = A_k z_k + G_k (g_k − x0) + D_k ġ_k + F_k.
"""

from __future__ import annotations

from dataclasses import dataclass

from handover_dmp.errors import DataError
import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

Array = NDArray[np.float64]

BLOCK = 8  # intervals of a batch that one matrix product covers
COLUMNS = 1536  # of one product: too few to be worth threads, few enough for the cache
NOTHING = 1e-13  # a goal that weighs less than this, relative to the heaviest, is not seen


@dataclass(frozen=True, eq=False)
class Intervals:
    """
    The recursion over m intervals; index 0 of the first axis is for x, index 1 for ẋ.

    Attributes:
        carry: A, (2, 2, m).
        goal: G, (2, m).
        goal_velocity: D, (2, m).
        forcing: F, (2, m, e): e is the number of dimensions, or of shapes looked at singly.

    """

    carry: Array
    goal: Array
    goal_velocity: Array
    forcing: Array

    def merged(self, counts: NDArray[np.int64]) -> Intervals:
        """
        Join the parts that samples far from each other were divided into.

        Args:
            counts: parts of each interval between samples, (n,), m in sum.

        Returns:
            The recursion over n intervals.

        """
        parts = np.concatenate(
            [
                self.carry.transpose(2, 0, 1),
                self.goal.T[:, :, None],
                self.goal_velocity.T[:, :, None],
                self.forcing.transpose(1, 0, 2),
            ],
            axis=2,
        )
        ends = np.cumsum(counts)
        joined = parts[ends - counts]
        for later in range(1, int(counts.max(initial=1))):
            longer = np.flatnonzero(counts > later)
            part = parts[(ends - counts)[longer] + later]
            push = part[:, :, :2] @ joined[longer]
            push[:, :, 2:] += part[:, :, 2:]
            joined[longer] = push
        columns = joined.transpose(1, 2, 0)
        return Intervals(
            columns[:, :2], columns[:, 2], columns[:, 3], columns[:, 4:].transpose(0, 2, 1)
        )

    def run(self, inputs: Array, velocity: Array | None = None) -> Array:
        """
        Solve the recursion z_{k+1} = A_k z_k + c_k from x = x0.

        Args:
            inputs: c, (2, m, e).
            velocity: ẋ at the start, (e,); at rest if left out.

        Returns:
            z, (e, m + 1, 2).

        """
        _, count, width = inputs.shape
        right = np.zeros((width, count + 1, 2))
        if velocity is not None:
            right[:, 0, 1] = velocity
        right[:, 1:] = inputs.transpose(2, 1, 0)
        # rows 2k and 2k + 1 of a unit lower triangular system of bandwidth 3
        band = np.zeros((count + 1, 2, 4))
        np.negative(self.carry[0, 0], out=band[:-1, 0, 2])
        np.negative(self.carry[1, 0], out=band[:-1, 0, 3])
        np.negative(self.carry[0, 1], out=band[:-1, 1, 1])
        np.negative(self.carry[1, 1], out=band[:-1, 1, 2])
        solution, _ = dtbtrs(
            band.reshape(-1, 4).T,
            right.reshape(width, -1).T,
            uplo='L',
            diag='U',
            overwrite_b=True,
        )
        path: Array = solution.T.reshape(right.shape)
        return path

    def run_batch(
        self,
        goals: Array,
        goal_velocities: Array,
        starts: Array,
        out: tuple[Array, Array] | None = None,
    ) -> tuple[Array, Array]:
        """
        Solve the recursion from rest for many goals.

        Blocks of intervals become one matrix product each, and where the goal has no weight yet
        all motions are one.

        Args:
            goals: g, m, (b, m + 1, d).
            goal_velocities: ġ, m/s, (b, m + 1, d).
            starts: x0, m, (b, d).
            out: what an earlier call for as many returned, to be written over.

        Returns:
            x, m, and ẋ, m/s, (b, m + 1, d) each, with time first in memory and b last.

        Raises:
            DataError: `out` is of another size or order.

        """
        batch, samples, dimensions = goals.shape
        count = samples - 1
        shape = (samples, dimensions, batch)
        positions, velocities = (
            (np.empty(shape), np.empty(shape))
            if out is None
            else (out[0].transpose(1, 2, 0), out[1].transpose(1, 2, 0))
        )
        if any(
            each.shape != shape or not each.flags.c_contiguous for each in (positions, velocities)
        ):
            raise DataError('out is not what an earlier call for as many rollouts returned')
        seen = np.abs(np.concatenate([self.goal, self.goal_velocity])).max(axis=0, initial=0.0)
        first = int(np.argmax(np.append(seen > NOTHING * seen.max(initial=0.0), True)))
        common = self.run(self.forcing)
        np.add(common[:, : first + 1, 0].T[:, :, None], starts.T, out=positions[: first + 1])
        velocities[: first + 1] = common[:, : first + 1, 1].T[:, :, None]

        # until they are needed, goals wait where the motion will be: memory is what takes the time
        _turn(goals[:, first:count], positions[first + 1:])  # fmt: skip
        _turn(goal_velocities[:, first:count], velocities[first + 1:])  # fmt: skip
        flat_positions = positions.reshape(samples, -1)
        flat_velocities = velocities.reshape(samples, -1)
        columns = [
            slice(column, column + COLUMNS)
            for column in range(0, flat_positions.shape[1], COLUMNS)
        ]
        whole = count - (count - first) % BLOCK
        for begin, end, length in ((first, whole, BLOCK), (whole, count, count - whole)):
            if begin == end:
                continue
            known = np.zeros((3 + dimensions + 2 * length, dimensions, batch))
            known[2] = starts.T
            known[3 + np.arange(dimensions), np.arange(dimensions)] = 1.0
            rows = known.reshape(len(known), -1)
            for k, matrix in zip(
                range(begin, end, length), self._blocks(begin, end, length), strict=True
            ):
                after = slice(k + 1, k + 1 + length)
                rows[0], rows[1] = flat_positions[k], flat_velocities[k]
                rows[-2 * length: -length] = flat_positions[after]  # fmt: skip
                rows[-length:] = flat_velocities[after]
                for part in columns:
                    np.matmul(matrix[:length], rows[:, part], out=flat_positions[after, part])
                    np.matmul(matrix[length:], rows[:, part], out=flat_velocities[after, part])
        return positions.transpose(2, 0, 1), velocities.transpose(2, 0, 1)

    def _blocks(self, begin: int, end: int, length: int) -> Array:
        """
        Chain intervals in groups.

        Args:
            begin: first interval.
            end: the one after the last.
            length: intervals of a group.

        Returns:
            From x, ẋ, x0, one column a dimension for F, and g and ġ of each interval, to x and
            then ẋ at the ends of the intervals, (groups, 2·length, 3 + d + 2·length).

        """
        dimensions = self.forcing.shape[2]
        groups = (end - begin) // length
        chain = np.zeros((groups, 2, 3 + dimensions + 2 * length))
        chain[:, 0, 0] = chain[:, 1, 1] = 1.0
        matrices = np.empty((groups, 2, length, chain.shape[2]))
        goal_column = 3 + dimensions
        for each in range(length):
            at = slice(begin + each, end, length)
            carry = self.carry[:, :, at].transpose(2, 0, 1)
            chain = carry @ chain
            # x0 pushes by what the recursion leaves of it when everything else is 0
            chain[:, :, 2] -= carry[:, :, 0] + self.goal[:, at].T
            chain[:, 0, 2] += 1.0
            chain[:, :, 3:goal_column] += self.forcing[:, at].transpose(1, 0, 2)
            chain[:, :, goal_column + each] += self.goal[:, at].T
            chain[:, :, goal_column + length + each] += self.goal_velocity[:, at].T
            matrices[:, :, each] = chain
        return matrices.reshape(groups, 2 * length, -1)


def _turn(values: Array, out: Array) -> None:
    """Copy (b, n, d) to (n, d, b)."""
    batch, samples, dimensions = values.shape
    flat = values.reshape(batch, samples * dimensions)
    np.copyto(out.reshape(samples * dimensions, batch), flat.T)
