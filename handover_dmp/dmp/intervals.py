"""
The transformation system between the samples of a rollout, as a linear recursion.

With z = (x − x0, ẋ) it reads z_{k+1} = A_k z_k + G_k (g_k − x0) + D_k ġ_k + F_k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtbtrs

Array = NDArray[np.float64]

BLOCK = 8  # intervals that one matrix product of a batch covers


@dataclass(frozen=True, eq=False)
class Intervals:
    """
    The recursion over m intervals.

    Attributes:
        carry: A, (m, 2, 2).
        goal: G, (m, 2).
        goal_velocity: D, (m, 2).

    """

    carry: Array
    goal: Array
    goal_velocity: Array

    def merged(self, counts: NDArray[np.int64], forcing: Array) -> tuple[Intervals, Array]:
        """
        Join the parts that samples far from each other were divided into.

        Args:
            counts: parts of each interval between samples, (n,), m in sum.
            forcing: F of the parts, (m, 2, d).

        Returns:
            The recursion over n intervals, and its F, (n, 2, d).

        """
        inputs = np.concatenate(
            [self.goal[:, :, None], self.goal_velocity[:, :, None], forcing], axis=2
        )
        part = 0
        carries, pushes = [], []
        for count in counts:
            carry, push = self.carry[part], inputs[part]
            for later in range(part + 1, part + count):
                carry = self.carry[later] @ carry
                push = self.carry[later] @ push + inputs[later]
            carries.append(carry)
            pushes.append(push)
            part += count
        push = np.array(pushes)
        return Intervals(np.array(carries), push[:, :, 0], push[:, :, 1]), push[:, :, 2:]

    def run(self, first: Array, inputs: Array) -> Array:
        """
        Solve the recursion z_{k+1} = A_k z_k + c_k.

        Args:
            first: z_0, (2, d).
            inputs: c, (m, 2, d).

        Returns:
            z, (m + 1, 2, d).

        """
        count, _, dimensions = inputs.shape
        right = np.empty((dimensions, count + 1, 2))
        right[:, 0] = first.T
        right[:, 1:] = inputs.transpose(2, 0, 1)
        band = np.zeros((count + 1, 2, 4))
        band[:-1, 0, 2] = -self.carry[:, 0, 0]
        band[:-1, 0, 3] = -self.carry[:, 1, 0]
        band[:-1, 1, 1] = -self.carry[:, 0, 1]
        band[:-1, 1, 2] = -self.carry[:, 1, 1]
        solution, _ = dtbtrs(
            band.reshape(-1, 4).T,
            right.reshape(dimensions, -1).T,
            uplo='L',
            diag='U',
            overwrite_b=True,
        )
        return np.asarray(solution.T.reshape(dimensions, count + 1, 2).transpose(1, 2, 0))

    def run_batch(
        self, forcing: Array, goals: Array, goal_velocities: Array, starts: Array
    ) -> tuple[Array, Array]:
        """
        Solve the recursion from rest for many goals.

        Args:
            forcing: F, (m, 2, d).
            goals: g, m, (b, m + 1, d).
            goal_velocities: ġ, m/s, (b, m + 1, d).
            starts: x0, m, (b, d).

        Returns:
            x, m, and ẋ, m/s, (b, m + 1, d) each, with time first in memory.

        """
        batch, samples, dimensions = goals.shape
        state = np.zeros((2, batch, dimensions))
        positions = np.empty((samples, batch, dimensions))
        velocities = np.empty((samples, batch, dimensions))
        positions[0], velocities[0] = starts, 0.0
        for k in range(samples - 1):
            state = np.einsum('ij,jbd->ibd', self.carry[k], state) + forcing[k][:, None, :]
            state += self.goal[k][:, None, None] * (goals[:, k] - starts)
            state += self.goal_velocity[k][:, None, None] * goal_velocities[:, k]
            positions[k + 1], velocities[k + 1] = state[0] + starts, state[1]
        return positions.transpose(1, 0, 2), velocities.transpose(1, 0, 2)
