"""The decoupled movement primitive of the paper, (6) to (8): shape first, goal later."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import erf, sqrt

from handover_dmp.dmp.primitive import Primitive
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf as erf_of_array

# (7) is 1 to the last bit of a float this many σ beyond μ
SETTLED_DEVIATIONS = 8.3


@dataclass(frozen=True, eq=False)
class DecoupledDmp(Primitive):
    """
    The decoupled primitive (8), weighted by (7): w_g(u) = ½[1 + erf((u − μ)/(σ√2))].

    While w_g is 0 the motion follows the learnt shape from where it started and takes no notice
    of the goal; as w_g grows to 1 it is drawn to the goal and to its velocity, without ever
    having needed to know where the goal would be. Fields: see `Primitive`.
    """

    def weights_in_time(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Give (7).

        Args:
            u: −ln(s)/α, any shape.

        Returns:
            w_g, from 0 to 1, of the same shape.

        """
        mu, slope = self._erf
        weight: NDArray[np.float64] = 0.5 + 0.5 * erf_of_array((u - mu) * slope)
        return weight

    @cached_property
    def _erf(self) -> tuple[float, float]:
        return self.parameters.mu, 1.0 / (self.parameters.sigma * sqrt(2.0))

    def _weight_pair(self, first: float, second: float) -> tuple[float, float]:
        mu, slope = self._erf
        return 0.5 + 0.5 * erf((first - mu) * slope), 0.5 + 0.5 * erf((second - mu) * slope)

    @property
    def _settled(self) -> float:
        return self.parameters.mu + SETTLED_DEVIATIONS * self.parameters.sigma

    @property
    def _sharpest(self) -> float:
        return self.parameters.sigma / 4.0

    @cached_property
    def _goal_velocity_gain(self) -> float:
        return self.parameters.effective_goal_velocity_gain(self.duration_s)
