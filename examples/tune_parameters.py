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

"""Find better parameters for a data set, and test them on unseen trials."""

from __future__ import annotations

from pathlib import Path
import sys

from handover_dmp.evaluation.tuning import tune
from handover_dmp.mocap import read_data_set, synthesize


def main(arguments: list[str]) -> None:
    """Tune on a data set folder or a synthetic one; a second argument is the number of tries."""
    trials = read_data_set(Path(arguments[0])) if arguments else synthesize(seed=0)
    found = tune(trials, candidates=int(arguments[1]) if len(arguments) > 1 else 48)
    print(f'{found.candidates} sets of parameters tried on {found.trials} trials')
    for name in ('stiffness', 'mu', 'sigma', 'goal_velocity_gain'):
        before, after = (getattr(one.parameters, name) for one in (found.default, found.best))
        print(f'{name:<20} {before:8.3f} -> {after:8.3f}')
    for compared in found.comparisons:
        low, high = (1e3 * bound for bound in compared.gain_interval_m)
        print(
            f'learn {compared.learn}: {1e3 * compared.default.rms_m:.1f} -> '
            f'{1e3 * compared.tuned.rms_m:.1f} mm from the person on unseen trials '
            f'(gain {1e3 * compared.gain_m:.1f} mm, 95 %: {low:.1f} to {high:.1f})'
        )


if __name__ == '__main__':
    main(sys.argv[1:])
