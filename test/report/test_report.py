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

from __future__ import annotations

from collections.abc import Callable
from html.parser import HTMLParser
import json
from pathlib import Path
from typing import Any

from handover_dmp.report import load_run, write_report
from handover_dmp.report.figures import draw_joints
from PIL import Image
import pytest

FIGURES = ['positions', 'paths', 'speeds', 'phase', 'joints', 'inverse_kinematics', 'timing']


class Page(HTMLParser):
    """What a page refers to, and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.links: list[str] = []
        self.words = ''
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag == 'img':
            self.sources.append(found['src'] or '')
        if tag in ('link', 'script', 'iframe'):
            self.links.append(tag)

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.fixture(scope='module')
def reported(
    make_run: Callable[..., Path],
    make_motion: Callable[..., Any],
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp('reports') / 'run'
    make_run(folder / 'bag', make_motion(hand_speed=0.2))
    (folder / 'figures').mkdir()
    for name in ('start', 'middle', 'exchange'):
        Image.new('RGB', (40, 30), 'grey').save(folder / 'figures' / f'scene_{name}.png')
    return folder, write_report(folder)


def test_everything_is_there(reported: tuple[Path, dict[str, Any]]) -> None:
    folder, report = reported
    assert report['figures'] == [*FIGURES, 'scene_start', 'scene_middle', 'scene_exchange']
    assert json.loads((folder / 'report.json').read_text()) == report
    assert {path.name for path in folder.iterdir()} == {
        'bag', 'figures', 'index.html', 'report.json', 'report.md',
    }  # fmt: skip


def test_figures_are_pictures_of_a_legible_size(reported: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = reported
    for name in FIGURES:
        with Image.open(folder / 'figures' / f'{name}.png') as image:
            assert image.width >= 1000
            assert image.height >= 400
            # not blank: many shades, and the colour of the robot among them
            colours = image.convert('RGB').getcolors(2**24)
            assert colours is not None
            assert len(colours) > 50


def test_the_page_opens_without_a_network(reported: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = reported
    page = Page((folder / 'index.html').read_text())
    assert page.links == []
    assert len(page.sources) == 10
    assert all(source.startswith('data:image/png;base64,') for source in page.sources)
    for words in (
        'The object changed hands.', 'handover_dmp simulate --seed 3', 'engine_bay give 1',
        'handover_dmp 0.1.0', '/hand/pose', '12.0 ms',
    ):  # fmt: skip
        assert words in page.words


def test_markdown_names_figures_that_exist(reported: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = reported
    text = (folder / 'report.md').read_text()
    named = [part.split(')')[0] for part in text.split('](')[1:]]
    assert len(named) == 10
    assert all((folder / name).is_file() for name in named)
    for line in text.splitlines():
        if line.startswith('| ---'):
            columns = line.count('|')
        elif line.startswith('|'):
            assert line.replace('\\|', '').count('|') in (3, 4, 5, 7)
    assert columns


def test_a_report_is_the_same_every_time(
    reported: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    folder, report = reported
    again = write_report(folder, tmp_path)
    assert again == {**report, 'figures': FIGURES}
    for name in FIGURES:
        file = f'figures/{name}.png'
        assert (tmp_path / file).read_bytes() == (folder / file).read_bytes(), name


def test_a_joint_without_limits_is_drawn_over_a_turn(
    make_run: Callable[..., Path], tmp_path: Path
) -> None:
    limits = {
        'lower': [-2.96] * 6 + [None],
        'upper': [2.96] * 6 + [None],
        'velocity': [3.0] * 7,
        'acceleration': [8.0] * 7,
    }
    told = {'joint_limits': limits}
    bag = make_run(tmp_path / 'run', info=told, leave_out=('/robot_description',))
    panel = draw_joints(load_run(bag)).axes[-2]
    low, high = panel.get_ylim()
    assert low <= -180.0
    assert high >= 180.0
    assert len(panel.lines) == 1
    write_report(bag)
    assert 'maximum use: position' in (tmp_path / 'run_report' / 'report.md').read_text()


def test_a_bare_bag(make_run: Callable[..., Path], tmp_path: Path) -> None:
    absent = (
        '/clock', '/human/pose', '/wrist/pose_command', '/wrist/twist_command', '/handover/state',
        '/joint_velocity_controller/commands', '/handover/phase', '/wrist/ik_status',
        '/diagnostics', '/handover/info', '/robot_description',
    )  # fmt: skip
    report = write_report(make_run(tmp_path / 'taken', leave_out=absent))
    assert report['figures'] == ['positions', 'paths', 'speeds', 'joints', 'timing']
    assert (tmp_path / 'taken_report' / 'index.html').is_file()
    assert {path.name for path in (tmp_path / 'taken').iterdir()} == {
        'metadata.yaml', 'taken_0.mcap',
    }  # fmt: skip
