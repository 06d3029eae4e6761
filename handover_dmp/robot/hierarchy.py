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

"""The arrays of a problem with levels, and the solver: daqp (Arnström and Axehill)."""

from __future__ import annotations

from collections.abc import Sequence
import math

import daqp
from handover_dmp.common.arrays import Array
from handover_dmp.robot.tasks import HalfSpace, Rows
import numpy as np

UNBOUNDED = 1e30
"""Infinity for daqp."""
SOFTNESS = 1e-7
"""Inverse weight of a task error in daqp; smaller is closer to strict priorities."""
IDLE_ROW = 1e-5
"""Rows whose entries are all smaller than this count as zero."""
SPEED_LEVEL = 1
"""Index of s among the levels of the tasks: after the first one, the wrist's direction."""
TOUCHING = 1e-7
"""A bound at most this far away counts as active, rad/s."""

Box = tuple[list[float], list[float]]
"""Lower and upper bounds of the joint velocities, rad/s."""


class Hierarchy:
    """
    A hierarchical problem of one size: least squares on each level within those above.

    Its variables are (q̇, s). Its rows are the half-spaces, then those of the tasks level by
    level, then one per joint for the preferences. Constant entries are filled in once, the
    others for every solution.
    """

    def __init__(
        self,
        dof: int,
        half_spaces: int,
        levels: Sequence[Sequence[Rows | None]],
        slowest: float = 1.0,
    ) -> None:
        """
        Allocate the arrays.

        Args:
            dof: number of joints.
            half_spaces: number of half-spaces.
            levels: rows of each task, for their shapes; None for an inactive task.
            slowest: minimum of s for the levels after the first; 1: s is not reduced.

        """
        first = dof + 1
        shapes = [[rows[0].shape for rows in level if rows] for level in levels]
        speed = [(1, first)]  # a row of the speed scale
        shapes.insert(SPEED_LEVEL, speed)
        least = {SPEED_LEVEL: slowest}
        if slowest < 1.0:
            least[len(shapes)] = 1.0
            shapes.append(speed)
        sizes = [sum(count for count, _ in level) for level in shapes]
        rows = half_spaces + sum(sizes) + dof
        self.matrix = np.zeros((rows, first))
        self.bounds = np.zeros((2, first + rows))  # bounds of the variables, then of the rows
        self.lower, self.upper = self.bounds
        self.sense = np.zeros(first + rows, dtype=np.intc)
        self.upper[dof] = 1.0
        self.upper[first: first + half_spaces] = UNBOUNDED  # fmt: skip
        self.matrix[-dof:, :dof] = np.eye(dof)
        # views of the parts
        self._box = self.bounds[:, :dof]
        self._wanted = self.lower[first:]
        self._preferred = self.bounds[:, -dof:]
        self._half_spaces = self.matrix[:half_spaces, :dof]
        self._half_space_bounds = self._wanted[:half_spaces]
        self._blocks = []
        self.parts = []
        end = half_spaces
        for level, blocks in enumerate(shapes):
            for count, width in blocks:
                start, end = end, end + count
                values = self.bounds[:, first + start: first + end]  # fmt: skip
                if level in least:
                    self.matrix[start, dof] = values[1] = 1.0
                    values[0] = least[level]
                else:
                    self.parts.append((start, end))
                    self._blocks.append((self.matrix[start:end, :width], values))
        ends = np.cumsum([first + half_spaces, *filter(None, sizes), dof])
        # a cost of |x|² only decides what all levels leave undetermined
        self._solver = daqp.Model()
        self._solver.setup(
            np.eye(first),
            np.zeros(first),
            self.matrix,
            self.upper,
            self.lower,
            self.sense,
            ends.astype(np.intc),
        )
        # without explicit weights each row would count in proportion to 1/|row|
        softness = np.full(first + rows, SOFTNESS)
        self._solver.soft_weights(softness, softness)

    def fill(
        self, box: Box, half_spaces: list[HalfSpace], tasks: list[Rows], preferred: Sequence[float]
    ) -> None:
        """
        Fill the arrays.

        Args:
            box: bounds of the joint velocities.
            half_spaces: the half-spaces, in the allocated number.
            tasks: rows of each task, in the allocated shapes.
            preferred: preferred joint velocities, n, rad/s.

        """
        self._box[:] = box
        for (block, values), (rows, wanted) in zip(self._blocks, tasks, strict=True):
            block[:] = rows
            if wanted is not None:
                values[:] = wanted
        self._preferred[:] = preferred
        if half_spaces:
            self._half_spaces[:] = [one.row for one in half_spaces]
            # braking as hard as possible is always feasible: level 1 always has a solution
            braking = [min(max(low, 0.0), high) for low, high in zip(*box, strict=True)]
            self._half_space_bounds[:] = np.minimum(
                [one.bound for one in half_spaces], self._half_spaces.dot(braking) - TOUCHING
            )

    def solve(self) -> tuple[Array, bool]:
        """
        Solve the problem from a cold start, so that no state is kept.

        Returns:
            (q̇, s), (n + 1,), rad/s, and whether they are a solution; zeros if there is none.

        """
        solution, solved = self._solution()
        if solved:
            return solution, True
        # daqp reports a task as infeasible if no joint affects it, as with a fully stretched arm
        first = self.matrix.shape[1]
        idle = first + np.flatnonzero(np.abs(self.matrix).max(axis=1) < IDLE_ROW)
        asked = self.bounds.copy()
        self.lower[idle] = np.minimum(self.lower[idle], 0.0)
        self.upper[idle] = np.maximum(self.upper[idle], 0.0)
        answer = self._solution()
        self.bounds[:] = asked
        return answer

    def missing(self, solution: Array) -> list[float]:
        """
        Compute the residual of each row.

        Args:
            solution: (q̇, s), (n + 1,), rad/s.

        Returns:
            The actual minus the desired value of each row; see `parts`.

        """
        missing: list[float] = (self.matrix.dot(solution) - self._wanted).tolist()
        return missing

    def _solution(self) -> tuple[Array, bool]:
        # lower and upper bounds are read together
        changed = self._solver.update(A=self.matrix, bupper=self.upper, sense=self.sense)
        if changed < 0:
            return np.zeros(self.matrix.shape[1]), False
        solution, _, flag, _ = self._solver.solve()
        if flag > 0 and math.isfinite(solution.dot(solution)):
            return solution, True
        return np.zeros(self.matrix.shape[1]), False
