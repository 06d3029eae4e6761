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
Make the pictures of the partner model: python scripts/write_partner_images.py DATASET [DRAWS].

They show the distance against the number of demonstrations, on that data set, and a simulated late
hand, met without and with the model, side by side.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from handover_dmp.cli.main import main as handover_dmp
from handover_dmp.common.threads import use_one_thread
from handover_dmp.dmp import save_model
from handover_dmp.evaluation.cases import make_cases
from handover_dmp.evaluation.few_demonstrations import draw_learning_curve, few_demonstrations
from handover_dmp.handover.recordings import example_model, example_trials
from handover_dmp.mocap import HandoverTrial, read_data_set, write_trial
import numpy as np

IMAGES = Path(__file__).resolve().parents[1] / 'docs' / 'images'
MAX_BYTES = 1_500_000
LATE_S = 1.0


def late(trial: HandoverTrial) -> HandoverTrial:
    """Let the hand of a handover begin one second late, otherwise unchanged."""
    period_s = float(trial.times[1] - trial.times[0])
    waiting = round(LATE_S / period_s)
    times = trial.times[0] + period_s * np.arange(len(trial.times) + waiting)
    partner, demonstrator = (
        np.vstack([np.repeat(path[:1], waiting, axis=0), path])
        for path in (trial.partner, trial.demonstrator)
    )
    return replace(trial, times=times, partner=partner, demonstrator=demonstrator)


def film(path: Path) -> None:
    """Simulate a late hand without and with the model, and render both side by side."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        save_model(example_model(), folder / 'model.json')
        write_trial(late(example_trials()[1]), folder / 'late.csv')
        inputs = [str(folder / 'model.json'), str(folder / 'late.csv')]
        runs = {'off': folder / 'without partner model', 'auto': folder / 'with partner model'}
        for word, run in runs.items():
            if handover_dmp(['simulate', *inputs, '-o', str(run), '--partner-model', word]):
                raise SystemExit(f'{run.name}: the handover failed')
        words = ['render', str(runs['off']), '--beside', str(runs['auto']), '-o', str(path)]
        if handover_dmp([*words, '--size', '480x400', '--rate', '20']):
            raise SystemExit(f'{path}: cannot be made')
    if path.suffix != '.mp4' and path.stat().st_size > MAX_BYTES:
        raise SystemExit(f'{path}: too large for a page')


def main(data_set: Path, draws: int) -> None:
    """Make both pictures."""
    use_one_thread()
    curve = few_demonstrations(
        make_cases(read_data_set(data_set)),
        draws=draws,
        progress=lambda done, total: print(f'{done} of {total} cases', flush=True),
    )
    for index, count in enumerate(curve.counts):
        print(count, {name: f'{1e3 * rms[index]:.1f} mm' for name, rms in curve.rms_m.items()})
    draw_learning_curve(curve, IMAGES / 'demonstrations.png')
    film(IMAGES / 'late_hand.webp')


if __name__ == '__main__':
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 7)
