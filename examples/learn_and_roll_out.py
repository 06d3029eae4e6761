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

"""Learn a handover from one recording and run it against the hand of another."""

from __future__ import annotations

from handover_dmp.handover.teaching import learn_from_trials, rollout_against
from handover_dmp.mocap import synthesize
import numpy as np


def main() -> None:
    """Print the distance of the motion from the person's, at every tenth of its duration."""
    first, second, *_ = [
        trial for trial in synthesize(seed=0)
        if (trial.configuration, trial.direction) == ('engine_bay', 'give')
    ]  # fmt: skip
    model = learn_from_trials([first])
    print(f'learnt from {model.source}: {model.duration_s:.2f} s')

    motion = rollout_against(model, second)
    for share in np.linspace(0.0, 1.0, 11):
        index = int(share * (len(motion.times) - 1))
        time_s, position = motion.times[index], motion.positions[index]
        person = [np.interp(time_s, second.times, axis) for axis in second.demonstrator.T]
        distance_mm = 1e3 * np.linalg.norm(position - person)
        weight = motion.goal_weight[index]
        print(f't = {time_s:.2f} s   w_g = {weight:.2f}   {distance_mm:5.1f} mm from the person')


if __name__ == '__main__':
    main()
