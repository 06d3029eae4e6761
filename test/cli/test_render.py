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

"""Films are what players and browsers take, and show the run from its start to its end."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
import subprocess
from types import ModuleType

from handover_dmp.cli.main import main
import numpy as np
from PIL import Image, ImageSequence
import pytest

imageio_ffmpeg = pytest.importorskip('imageio_ffmpeg')
pytestmark = pytest.mark.timeout(1800)  # on a machine that does much else
SMALL = ('--size', '160x120', '--rate', '10', '--jobs', '1')


@pytest.fixture(scope='module')
def runs() -> ModuleType:
    """Give the maker of runs of the tests of views."""
    path = Path(__file__).parents[1] / 'view' / 'conftest.py'
    spec = importlib.util.spec_from_file_location('view_runs', path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope='module')
def filmed(runs: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Film a run into its own folder."""
    folder = runs.write_run(tmp_path_factory.mktemp('filmed'))
    assert main(['render', str(folder), *SMALL, '--json', str(folder / 'made.json')]) == 0
    return folder


def pictures(video: Path) -> np.ndarray:
    """Decode a video with an independent reader: one array of all pictures."""
    reader = imageio_ffmpeg.read_frames(str(video))
    size = next(reader)['size']
    return np.array([np.frombuffer(one, np.uint8).reshape(size[1], size[0], 3) for one in reader])


def test_the_video_plays_for_as_long_as_it_says(filmed: Path) -> None:
    made = json.loads((filmed / 'made.json').read_text())
    decoded = pictures(filmed / 'handover.mp4')
    assert decoded.shape[1:] == (120, 160, 3)
    assert len(decoded) == made['pictures']
    # From 0.3 s before the arm moves to the end at 1.48 s, and a while of standing still.
    assert made['length_s'] == pytest.approx(1.38 + 0.8, abs=0.15)


def test_two_runs_side_by_side(filmed: Path, runs: ModuleType, tmp_path: Path) -> None:
    other = runs.write_run(tmp_path / 'other')
    words = ['render', str(filmed), '--beside', str(other), '-o', str(tmp_path / 'both.mp4')]
    assert main([*words, *SMALL]) == 0
    both, alone = pictures(tmp_path / 'both.mp4'), pictures(filmed / 'handover.mp4')
    assert both.shape == (len(alone), 120, 320, 3)
    # the same run on both sides, under another name
    left, right = both[:, 20:, :160].astype(float), both[:, 20:, 160:].astype(float)
    assert np.abs(left - right).mean() < 2.0
    assert np.abs(left - alone[:, 20:].astype(float)).mean() < 3.0
    assert np.abs(both[:, :20, :160].astype(float) - alone[:, :20]).max() > 50.0


def test_the_pixel_format_is_one_that_browsers_play(filmed: Path) -> None:
    words = [imageio_ffmpeg.get_ffmpeg_exe(), '-hide_banner', '-i', str(filmed / 'handover.mp4')]
    told = subprocess.run(words, capture_output=True, text=True).stderr
    assert 'Video: h264' in told
    assert 'yuv420p' in told


def test_something_moves_and_in_the_end_stands(filmed: Path) -> None:
    decoded = pictures(filmed / 'handover.mp4').astype(float)
    change = np.abs(np.diff(decoded, axis=0)).mean(axis=(1, 2, 3))
    assert change.max() > 10 * change[-1]
    assert np.abs(decoded[-1] - decoded[0]).max() > 60


def test_the_image_repeats_for_ever_and_is_small(filmed: Path) -> None:
    with Image.open(filmed / 'handover.webp') as image:
        assert image.size == (160, 120)
        assert image.info['loop'] == 0
        assert image.n_frames >= 5
    assert (filmed / 'handover.webp').stat().st_size < 200_000


def test_gif_and_other_speeds(runs: ModuleType, tmp_path: Path) -> None:
    folder = runs.write_run(tmp_path / 'run')
    gif = tmp_path / 'slow.gif'
    words = ['render', str(folder), '--no-video', '--image', str(gif), '--speed', '0.5', *SMALL]
    assert main(words) == 0
    with Image.open(gif) as image:
        lasting = [frame.info['duration'] for frame in ImageSequence.Iterator(image)]
    assert lasting[1] == 200  # 5 a second: every other picture
    assert sum(lasting) == pytest.approx(1000 * (2 * 1.38 + 0.8), abs=400)
    assert not (folder / 'handover.mp4').exists()


def test_several_processes_make_the_same_film(
    runs: ModuleType, filmed: Path, tmp_path: Path
) -> None:
    words = ['render', str(filmed), '-o', str(tmp_path), *SMALL[:-1], '2', '--no-image']
    assert main(words) == 0
    assert np.array_equal(pictures(tmp_path / 'handover.mp4'), pictures(filmed / 'handover.mp4'))


@pytest.mark.parametrize(
    ('words', 'fault', 'code'),
    [
        (('--no-video', '--no-image'), 'nothing to do', 2),
        (('--size', 'large'), '960x720', 2),
        (('--size', '161x120'), 'even', 2),
        (('--speed', '0'), 'no film', 2),
        (('--image', 'film.png'), '.webp or .gif', 2),
    ],
)
def test_what_makes_no_film(
    filmed: Path,
    words: tuple[str, ...],
    fault: str,
    code: int,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['render', str(filmed), *words]) == code
    error = capsys.readouterr().err
    assert fault in error
    assert len(error.strip().splitlines()) == 1


def test_no_half_film_is_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['render', str(tmp_path / 'absent'), '-o', str(tmp_path / 'film')]) == 1
    assert 'no such bag' in capsys.readouterr().err
    assert not list(tmp_path.rglob('*.mp4'))


def test_a_name_with_the_ending_of_a_film_makes_that_file(filmed: Path, tmp_path: Path) -> None:
    film = tmp_path / 'somewhere' / 'film.mp4'
    assert main(['render', str(filmed), *SMALL, '-o', str(film)]) == 0
    assert film.is_file()
    assert [path.name for path in tmp_path.rglob('*') if path.is_file()] == ['film.mp4']
    assert pictures(film).shape[1:] == (120, 160, 3)


@pytest.mark.parametrize(
    ('words', 'files'),
    [
        (['-o', 'film.mp4'], ('film.mp4', None)),
        (['-o', 'film.GIF'], (None, 'film.GIF')),
        (['-o', 'films'], ('films/handover.mp4', 'films/handover.webp')),
        (['-o', 'films', '--no-image'], ('films/handover.mp4', None)),
    ],
)
def test_a_file_name_means_the_file(words, files):
    import argparse
    from pathlib import Path

    from handover_dmp.cli import render

    parser = argparse.ArgumentParser()
    render.add_arguments(parser)
    video, image = (None if name is None else Path(name) for name in files)
    assert render.chosen_files(parser.parse_args(['run', *words])) == (video, image)


def test_a_figure_needs_no_run_and_a_film_needs_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['render']) == 2
    assert main(['render', str(tmp_path), '--figure', 'postures']) == 2
    assert main(['render', '--figure', 'postures', '-o', str(tmp_path / 'x.mp4')]) == 2
    told = capsys.readouterr().err
    assert 'no run given' in told
    assert '--figure postures takes no run' in told
    assert 'the name of a picture must end in .png' in told


@pytest.mark.slow
def test_figure_of_the_postures_shows_a_person_and_an_arm_three_times(tmp_path: Path) -> None:
    words = ['-o', str(tmp_path / 'fig2.png'), '--json', str(tmp_path / 'made.json')]
    assert main(['render', '--figure', 'postures', *words]) == 0
    assert json.loads((tmp_path / 'made.json').read_text())['robot'] == 'lwr4'
    picture = np.asarray(Image.open(tmp_path / 'fig2.png')).astype(float)
    for panel in np.split(picture, 3, axis=1):
        hue = panel / (1.0 + np.linalg.norm(panel, axis=2, keepdims=True))
        for colour in ((0.95, 0.45, 0.10), (0.23, 0.44, 0.58)):  # the arm's shells, the shirt
            seen = np.linalg.norm(hue - np.array(colour) / np.linalg.norm(colour), axis=2) < 0.15
            assert seen.sum() > 4000
