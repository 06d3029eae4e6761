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

"""The video and the page of a recorded session."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from handover_dmp.view.page import write_page
from handover_dmp.view.stage import Stage
from handover_dmp.view.video import Film, HOLD_S, paint, save_animation
from PIL import Image

FILM = 'session.webp'
PAGE = 'session.html'
STYLE = Film(width=640, height=480, rate_hz=10.0)


def film_session(
    stage: Stage, folder: Path, progress: Callable[[float], None] = lambda _share: None
) -> None:
    """
    Film a session and write its page with a time slider.

    Args:
        stage: the recorded session.
        folder: output folder for `session.webp` and `session.html`.
        progress: called with the finished share.

    Raises:
        DataError: a file cannot be written.

    """
    times = STYLE.times(stage)
    pictures = []
    for number, picture in enumerate(paint(stage, STYLE, times)):
        pictures.append(Image.fromarray(picture))
        progress(number / len(times))
    pictures += pictures[-1:] * round(HOLD_S * STYLE.rate_hz)
    save_animation(pictures, folder / FILM, 1.0 / STYLE.rate_hz)
    write_page(stage, folder / PAGE)
