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

"""The minimum-jerk reach of an oracle that knows where and when the hands will meet."""

from __future__ import annotations

from handover_dmp.common.arrays import Array
from handover_dmp.mocap.typical import SAMPLES
import numpy as np


def minimum_jerk(start: Array, end: Array, samples: int = SAMPLES) -> Array:
    """
    Reach from rest at one point to rest at another with the least possible jerk.

    Flash and Hogan (1985): x0 + (x1 − x0)(10u³ − 15u⁴ + 6u⁵), the quintic without velocity and
    acceleration at its ends. As a function of the fraction of its duration it is always the same.

    Args:
        start: (d,) m.
        end: (d,) m.
        samples: number of equally spaced samples, including both ends.

    Returns:
        (samples, d) m.

    """
    still = np.zeros_like(start)
    # takes longer to load than the rest of the package
    from scipy.interpolate import BPoly

    quintic = BPoly.from_derivatives([0.0, 1.0], [[start, still, still], [end, still, still]])
    return np.asarray(quintic(np.linspace(0.0, 1.0, samples)))
