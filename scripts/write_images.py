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

"""Make the pictures of README and docs: python scripts/write_images.py [RUN SESSION]."""

from __future__ import annotations

from pathlib import Path
import shutil
import sys
from tempfile import TemporaryDirectory

from handover_dmp.cli.main import main as handover_dmp
from handover_dmp.handover.approach_figure import draw_approach
from handover_dmp.handover.recordings import example_model

IMAGES = Path(__file__).resolve().parents[1] / 'docs' / 'images'
MAX_BYTES = 3_000_000
NEAR_SHARE = 0.27
"""Distance of the hand in the figure of the approach, as a fraction of the learnt one."""


def main(run: Path, session: Path) -> None:
    """
    Render the run at half speed, copy its figure of the three axes, and draw the approach.

    Copy film and figure of the session, and draw the postures of the partner.
    """
    film = IMAGES / 'handover.webp'
    words = ['--no-video', '--image', str(film), '--speed', '0.5', '--size', '800x600']
    if handover_dmp(['render', str(run), *words]):
        raise SystemExit(f'{run}: cannot be rendered')
    shutil.copyfile(run / 'figures' / 'positions.png', IMAGES / 'positions.png')
    draw_approach(example_model(), NEAR_SHARE, IMAGES / 'approach.png')
    shutil.copyfile(session / 'session.webp', IMAGES / 'session.webp')
    if handover_dmp(['render', '--figure', 'postures', '-o', str(IMAGES / 'postures.webp')]):
        raise SystemExit('the postures cannot be drawn')
    for made in (film, IMAGES / 'session.webp'):
        if made.stat().st_size > MAX_BYTES:
            raise SystemExit(f'{made}: too large for a README')


if __name__ == '__main__':
    if len(sys.argv) > 2:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
    else:
        with TemporaryDirectory() as folder:
            run, session = Path(folder) / 'run', Path(folder) / 'session'
            if handover_dmp(['simulate', '-o', str(run)]):
                raise SystemExit('the handover failed')
            if handover_dmp(['simulate', '--session', '-o', str(session)]):
                raise SystemExit('the session failed')
            main(run, session)
