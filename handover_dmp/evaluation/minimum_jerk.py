"""The minimum-jerk reach: what one would do who knew where and when the hands will meet."""

from __future__ import annotations

from handover_dmp.evaluation.envelope import Array, SAMPLES
import numpy as np
from scipy.interpolate import BPoly


def minimum_jerk(start: Array, end: Array, samples: int = SAMPLES) -> Array:
    """
    Reach from rest at one point to rest at another with the least possible jerk.

    Flash and Hogan (1985): x0 + (x1 − x0)(10u³ − 15u⁴ + 6u⁵), the quintic without velocity and
    acceleration at its ends. Over fractions of its duration it is the same for every duration.

    Args:
        start: (d,) m.
        end: (d,) m.
        samples: equally spaced samples of it, both ends included.

    Returns:
        (samples, d) m.

    """
    still = np.zeros_like(start)
    quintic = BPoly.from_derivatives([0.0, 1.0], [[start, still, still], [end, still, still]])
    return np.asarray(quintic(np.linspace(0.0, 1.0, samples)))
