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

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
import os

from handover_dmp.common.arrays import Array
import numpy as np
from numpy.typing import NDArray

BLOCK = 8  # intervals of a batch that one matrix product covers
SHARE = 512  # motions of a batch that one thread works on: few enough for its cache
NOTHING = 1e-13  # goals with a smaller weight, relative to the largest, are ignored


@dataclass(frozen=True, eq=False)
class Intervals:
    """
    The recursion over m intervals; index 0 of the first axis is for x, index 1 for ẋ.

    Attributes:
        carry: A, (2, 2, m).
        goal: G, (2, m).
        goal_velocity: D, (2, m).
        forcing: F, (2, m, e): e is the number of dimensions, or of single shapes.

    """

    carry: Array
    goal: Array
    goal_velocity: Array
    forcing: Array

    def merged(self, counts: NDArray[np.int64]) -> Intervals:
        """
        Join the parts into which long intervals were divided.

        Args:
            counts: number of parts of each interval between samples, (n,), m in total.

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
            velocity: ẋ at the start, (e,); zero if left out.

        Returns:
            z, (e, m + 1, 2).

        """
        from scipy.linalg.lapack import dtbtrs

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
        self, goals: Array, goal_velocities: Array | None, starts: Array, steps_s: Array
    ) -> tuple[Array, Array]:
        """
        Solve the recursion from rest for many goals.

        Each block of intervals is one matrix product. As long as the goal has no weight, all
        motions are the same and are computed once. Large batches are split over the processors.

        Args:
            goals: g, m, (b, m + 1, d).
            goal_velocities: ġ, m/s, (b, m + 1, d); None: the differences of the goals.
            starts: x0, m, (b, d).
            steps_s: lengths of the intervals, s, (m,).

        Returns:
            x, m, and ẋ, m/s, (b, m + 1, d) each, with time first in memory and b last.

        """
        batch, samples, dimensions = goals.shape
        count = samples - 1
        path = np.empty((samples, 2, dimensions, batch))
        seen = np.abs(np.concatenate([self.goal, self.goal_velocity])).max(axis=0, initial=0.0)
        first = int(np.argmax(np.append(seen > NOTHING * seen.max(initial=0.0), True)))
        common = self.run(self.forcing)[:, : first + 1].transpose(1, 2, 0)[..., None]
        whole = count - (count - first) % BLOCK
        blocks: list[tuple[int, Array]] = []
        for begin, end, length in ((first, whole, BLOCK), (whole, count, count - whole)):
            if begin < end:
                matrices = self._blocks(begin, end, length)
                if goal_velocities is None:
                    matrices = _from_goal_to_goal(matrices, steps_s[begin:end])
                blocks += zip(range(begin, end, length), matrices, strict=True)

        def follow(part: slice) -> None:
            path[: first + 1, 0, :, part] = common[:, 0] + starts[part].T
            path[: first + 1, 1, :, part] = common[:, 1]
            velocities = None if goal_velocities is None else goal_velocities[part]
            _follow(path[..., part], blocks, goals[part], velocities, starts[part])

        shares = -(-batch // SHARE) or 1
        bounds = [batch * share // shares for share in range(shares + 1)]
        parts = [slice(begin, end) for begin, end in pairwise(bounds)]
        if shares == 1:
            follow(parts[0])
        else:
            with ThreadPoolExecutor(min(shares, os.cpu_count() or 1)) as threads:
                list(threads.map(follow, parts))
        return path[:, 0].transpose(2, 0, 1), path[:, 1].transpose(2, 0, 1)

    def _blocks(self, begin: int, end: int, length: int) -> Array:
        """
        Combine intervals into groups.

        Args:
            begin: index of the first interval.
            end: index after the last interval.
            length: number of intervals in a group.

        Returns:
            Matrices, (groups, d, 2·length, 4 + 2·length), from x, ẋ, x0, 1 (for F), and g and ġ of
            each interval, to x and ẋ at the end of each interval.

        """
        dimensions = self.forcing.shape[2]
        groups = (end - begin) // length
        # during construction, the columns of F for all dimensions are side by side
        chain = np.zeros((groups, 2, 3 + dimensions + 2 * length))
        chain[:, 0, 0] = chain[:, 1, 1] = 1.0
        goals = 3 + dimensions
        chained = np.empty((groups, length, *chain.shape[1:]))
        for each in range(length):
            at = slice(begin + each, end, length)
            carry = self.carry[:, :, at].transpose(2, 0, 1)
            chain = carry @ chain
            # the column of x0: the response of the recursion to x0 alone
            chain[:, :, 2] -= carry[:, :, 0] + self.goal[:, at].T
            chain[:, 0, 2] += 1.0
            chain[:, :, 3:goals] += self.forcing[:, at].transpose(1, 0, 2)
            chain[:, :, goals + each] += self.goal[:, at].T
            chain[:, :, goals + length + each] += self.goal_velocity[:, at].T
            chained[:, each] = chain
        chained = chained.reshape(groups, 1, 2 * length, -1)
        matrices = np.empty((groups, dimensions, 2 * length, 4 + 2 * length))
        matrices[..., :3] = chained[..., :3]
        matrices[..., 3] = chained[:, 0, :, 3:goals].transpose(0, 2, 1)
        matrices[..., 4:] = chained[..., goals:]
        return matrices


def _from_goal_to_goal(matrices: Array, steps_s: Array) -> Array:
    """
    Replace ġ of each interval by the goals at both of its ends, ġ = (g' − g)/Δt.

    Args:
        matrices: from `_blocks`, (groups, d, 2·length, 4 + 2·length).
        steps_s: Δt of all intervals, s, (groups·length,).

    Returns:
        Matrices from x, ẋ, x0, 1 and length + 1 goals, (groups, d, 2·length, 5 + length).

    """
    length = matrices.shape[2] // 2
    others, goal, goal_velocity = np.split(matrices, [4, 4 + length], axis=-1)
    rates = goal_velocity / steps_s.reshape(-1, 1, 1, length)
    goals = np.zeros((*matrices.shape[:-1], length + 1))
    goals[..., :-1] = goal - rates
    goals[..., 1:] += rates
    return np.concatenate([others, goals], axis=-1)


def _follow(
    path: Array,
    blocks: list[tuple[int, Array]],
    goals: Array,
    goal_velocities: Array | None,
    starts: Array,
) -> None:
    """Fill (m + 1, 2, d, b) from the first block on, with one matrix product per block."""
    samples, _, dimensions, batch = path.shape
    states = path.reshape(2 * samples, dimensions, batch).transpose(1, 0, 2)
    flat_goals = goals.reshape(batch, -1)
    flat_velocities = None if goal_velocities is None else goal_velocities.reshape(batch, -1)
    known = np.empty((0, dimensions, batch))
    for begin, matrices in blocks:
        length = matrices.shape[1] // 2
        if len(known) != matrices.shape[2]:
            known = np.empty((matrices.shape[2], dimensions, batch))
            known[2], known[3] = starts.T, 1.0
        known[:2] = path[begin]
        inputs = known[4:].reshape(-1, batch)
        first, end = begin * dimensions, (begin + length) * dimensions
        if flat_velocities is None:
            last = end + dimensions
            inputs[:] = flat_goals[:, first:last].T
        else:
            goal_rows, velocity_rows = np.split(inputs, 2)
            goal_rows[:] = flat_goals[:, first:end].T
            velocity_rows[:] = flat_velocities[:, first:end].T
        after = slice(2 * begin + 2, 2 * (begin + length) + 2)
        np.matmul(matrices, known.transpose(1, 0, 2), out=states[:, after])
