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
"""What daqp takes for infinity."""
SOFTNESS = 1e-7
"""Inverse weight of a missed task in daqp; smaller is nearer to strict priorities."""
IDLE_ROW = 1e-5
"""Rows whose entries are all smaller than this are taken for zero."""
SPEED_LEVEL = 1
"""Place of s among the levels of the tasks: behind the first, the wrist's direction."""
TOUCHING = 1e-7
"""A bound this near counts as active, rad/s."""

Box = tuple[list[float], list[float]]
"""Lower and upper bounds of the joint velocities, rad/s."""


class Hierarchy:
    """
    A hierarchical problem of one size: least squares on each level within those above.

    Its variables are (q̇, s). Its rows are the half-spaces, then those of the tasks level by
    level, then one for each joint, for what the joints prefer. The arrays are filled anew for
    every solution, and what never changes is filled in once.
    """

    def __init__(
        self,
        dof: int,
        half_spaces: int,
        levels: Sequence[Sequence[Rows | None]],
        slowest: float = 1.0,
    ) -> None:
        """
        Make room.

        Args:
            dof: number of joints.
            half_spaces: their number.
            levels: rows of each task, for their shapes; None for a task that asks for nothing.
            slowest: how small s may become for the levels behind the first; 1: not at all.

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
        self.bounds = np.zeros((2, first + rows))  # of the variables, then of the rows
        self.lower, self.upper = self.bounds
        self.sense = np.zeros(first + rows, dtype=np.intc)
        self.upper[dof] = 1.0
        self.upper[first: first + half_spaces] = UNBOUNDED  # fmt: skip
        self.matrix[-dof:, :dof] = np.eye(dof)
        # views of their parts
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
        # a cost of |x|² only decides what all levels leave open
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
        # without weights of its own each row would count in proportion to 1/|row|
        softness = np.full(first + rows, SOFTNESS)
        self._solver.soft_weights(softness, softness)

    def fill(
        self, box: Box, half_spaces: list[HalfSpace], tasks: list[Rows], preferred: Sequence[float]
    ) -> None:
        """
        Fill the arrays.

        Args:
            box: of the joint velocities.
            half_spaces: as many as there is room for.
            tasks: rows of each task, of the shapes that there is room for.
            preferred: joint velocities, n, rad/s.

        """
        self._box[:] = box
        for (block, values), (rows, wanted) in zip(self._blocks, tasks, strict=True):
            block[:] = rows
            if wanted is not None:
                values[:] = wanted
        self._preferred[:] = preferred
        if half_spaces:
            self._half_spaces[:] = [one.row for one in half_spaces]
            # braking as hard as possible is always allowed: level 1 always has a solution
            braking = [min(max(low, 0.0), high) for low, high in zip(*box, strict=True)]
            self._half_space_bounds[:] = np.minimum(
                [one.bound for one in half_spaces], self._half_spaces.dot(braking) - TOUCHING
            )

    def solve(self) -> tuple[Array, bool]:
        """
        Solve it, always from a cold start: without state.

        Returns:
            (q̇, s), (n + 1,), rad/s, and whether they solve it; zeros where nothing does.

        """
        solution, solved = self._solution()
        if solved:
            return solution, True
        # a task that no joint can serve, as with an arm stretched straight, is called infeasible
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
        Compute what is missing in each row.

        Args:
            solution: (q̇, s), (n + 1,), rad/s.

        Returns:
            Row by row, what it comes to less what it should; see `parts`.

        """
        missing: list[float] = (self.matrix.dot(solution) - self._wanted).tolist()
        return missing

    def _solution(self) -> tuple[Array, bool]:
        # the lower bounds are read again along with the upper ones
        changed = self._solver.update(A=self.matrix, bupper=self.upper, sense=self.sense)
        if changed < 0:
            return np.zeros(self.matrix.shape[1]), False
        solution, _, flag, _ = self._solver.solve()
        if flag > 0 and math.isfinite(solution.dot(solution)):
            return solution, True
        return np.zeros(self.matrix.shape[1]), False
