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

"""Follow a goal of constant velocity: (8) does not lag behind it, the classical primitive does."""

from __future__ import annotations

from handover_dmp.dmp import ClassicalDmp, DecoupledDmp
from handover_dmp.handover.teaching import learn_from_trials
from handover_dmp.mocap import synthesize
import numpy as np

SPEED = np.array([0.2, 0.0, 0.0])  # m/s
PERIOD_S = 0.005


def main() -> None:
    """Print the lag after two seconds, stepping as a controller does."""
    trial = synthesize(seed=0)[0]
    for kind in (DecoupledDmp, ClassicalDmp):
        model = learn_from_trials([trial], primitive=kind, regression='ridge')
        state = model.initial_state()
        goal = np.array(model.goal)
        for _ in range(round(2.0 * model.duration_s / PERIOD_S)):
            state = model.step(state, tuple(goal), tuple(SPEED), PERIOD_S)
            goal += SPEED * PERIOD_S
        lag_mm = 1e3 * np.linalg.norm(goal - state.position)
        print(f'{kind.__name__:<14} lags {lag_mm:7.3f} mm behind a goal at 0.2 m/s')


if __name__ == '__main__':
    main()
