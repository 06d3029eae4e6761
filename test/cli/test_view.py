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

"""The page shows the run in a browser, without a network, at the time that the slider says."""

from __future__ import annotations

import base64
import importlib.util
import json
from pathlib import Path
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from types import ModuleType
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen
from xml.etree import ElementTree

from handover_dmp.cli.main import main
from handover_dmp.robot.descriptions import example_robot_data_folder
import numpy as np
from PIL import Image
import pytest

pytest.importorskip('meshcat')
umsgpack = pytest.importorskip('umsgpack')
CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser')
PATIENCE_S = 900.0
pytestmark = pytest.mark.timeout(1800)  # on a machine that does much else


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
def page(runs: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the page of a run."""
    folder = runs.write_run(tmp_path_factory.mktemp('viewed'))
    page = folder / 'page.html'
    assert main(['view', str(folder), '-o', str(page)]) == 0
    return page


def browse(address: str, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Open a page in a browser without a window, and a network it may not use."""
    if CHROMIUM is None:
        pytest.skip('chromium is not installed')
    return subprocess.run(
        [
            CHROMIUM, '--headless', '--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader',
            '--disable-background-networking', f'--user-data-dir={folder / "profile"}',
            '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1',
            '--window-size=640,480', '--virtual-time-budget=5000', '--enable-logging=stderr',
            *words, address,
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )  # fmt: skip


def screenshot(address: str, folder: Path) -> np.ndarray:
    """Take a picture of a page; nothing may have gone wrong in it."""
    picture = folder / 'screen.png'
    result = browse(address, folder, f'--screenshot={picture}')
    assert 'Uncaught' not in result.stderr, result.stderr
    assert 'PropertyBinding' not in result.stderr, result.stderr
    return np.asarray(Image.open(picture).convert('RGB')).astype(float)


def near(picture: np.ndarray, colour: tuple[float, float, float]) -> int:
    """Count the pixels of a colour, whatever its brightness."""
    rgb = picture + 1.0
    rgb /= np.linalg.norm(rgb, axis=2, keepdims=True)
    wanted = np.array(colour) / np.linalg.norm(colour)
    return int((np.linalg.norm(rgb - wanted, axis=2) < 0.12).sum())


def test_a_browser_shows_robot_person_and_object(page: Path, tmp_path: Path) -> None:
    picture = screenshot(f'{page.as_uri()}#t=0.9', tmp_path)[:400]  # without the bar
    assert near(picture, (0.95, 0.45, 0.10)) > 500  # the arm
    assert near(picture, (0.23, 0.44, 0.58)) > 500  # the shirt
    assert near(picture, (0.98, 0.80, 0.15)) > 20  # the object


def test_the_slider_moves_the_scene_and_the_trails_grow(page: Path, tmp_path: Path) -> None:
    before = screenshot(f'{page.as_uri()}#t=0.0', tmp_path)[:400]
    after = screenshot(f'{page.as_uri()}#t=1.3', tmp_path)[:400]
    assert (np.abs(after - before).max(axis=2) > 40).sum() > 500
    for colour in ((1.0, 0.16, 0.18), (0.12, 0.48, 1.0)):
        assert near(after, colour) > near(before, colour) + 20


def test_the_bar_tells_time_and_state(page: Path, tmp_path: Path) -> None:
    document = browse(f'{page.as_uri()}#t=1.2', tmp_path, '--dump-dom').stdout
    assert re.search(r'id="now">0\.90 s<', document)  # zero is where the arm began to move
    assert re.search(r'id="state">exchange<', document)


def test_the_page_asks_for_nothing_from_elsewhere(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    head = re.sub(r'<script>.*?</script>', '', text, flags=re.DOTALL)
    assert not re.search(r'(src|href)="(?!data:)', head)
    assert 'WebSocket' not in text.rpartition('<script>')[2]


def messages_of(page: Path) -> list[dict[str, Any]]:
    """Unpack what the viewer is told, as the viewer does."""
    packed = re.search(r'^const commands = (.*);$', page.read_text(encoding='utf-8'), re.MULTILINE)
    return [umsgpack.unpackb(base64.b64decode(one)) for one in json.loads(packed[1])]


def test_no_part_of_an_arm_is_lost(runs: ModuleType, tmp_path: Path) -> None:
    """Count the triangles in the mesh files of the UR5 (Collada, several meshes a file)."""
    folder = runs.write_run(tmp_path / 'run', 'ur5')
    page = tmp_path / 'page.html'
    assert main(['view', str(folder), '-o', str(page)]) == 0
    drawn = sum(
        geometry['data']['index']['array'].data.__len__() // 12  # three numbers of four bytes
        for message in messages_of(page)
        if message['type'] == 'set_object' and message['path'].startswith('/meshcat/robot')
        for geometry in message['object']['geometries']
    )
    model = runs.RobotModel.load('ur5')
    counted = 0
    for mesh in ElementTree.fromstring(model.urdf_text).iterfind('link/visual/geometry/mesh'):
        name = mesh.get('filename').removeprefix('package://example-robot-data/')
        text = (example_robot_data_folder() / name).read_text(encoding='utf-8')
        counted += sum(map(int, re.findall(r'<triangles[^>]* count="(\d+)"', text)))
    assert counted > 10_000
    assert drawn == pytest.approx(counted, rel=0.01)


def test_poses_in_the_page_are_those_of_the_run(runs: ModuleType, page: Path) -> None:
    """Follow the wrist by the robot's last link."""
    messages = messages_of(page)
    (animation,) = (m for m in messages if m['type'] == 'set_animation')
    drawn = {m['path'] for m in messages if m['type'] == 'set_object'}
    model = runs.RobotModel.load('lwr4', base=runs.BASE)
    ends = {
        round(time_s, 3): model.wrist_pose(runs.joints_at(model, time_s))[0]
        for time_s in (0.1, 1.48)
    }
    movers = [
        clip for clip in animation['animations'] if clip['path'].startswith('/meshcat/robot')
    ]
    assert len(movers) >= 7
    nearest = dict.fromkeys(ends, np.inf)
    for clip in movers:
        assert clip['path'] in drawn
        keys = next(t['keys'] for t in clip['clip']['tracks'] if t['name'] == '.position')
        assert keys[0]['time'] == 0.0
        assert keys[-1]['time'] == pytest.approx(1.38, abs=0.02)
        for (time_s, wrist), key in zip(ends.items(), (keys[0], keys[-1]), strict=True):
            distance = float(np.linalg.norm(np.array(key['value']) - wrist))
            nearest[time_s] = min(nearest[time_s], distance)
    # The hull of the last link is about the wrist.
    assert max(nearest.values()) < 0.12
    assert nearest[0.1] == pytest.approx(nearest[1.48], abs=1e-3)


def test_the_page_is_offered_on_loopback_alone_until_told_to_end(
    runs: ModuleType, tmp_path: Path
) -> None:
    folder = runs.write_run(tmp_path / 'run')
    told = tmp_path / 'told.json'
    words = ['view', str(folder), '--no-browser', '--json', str(told)]
    process = subprocess.Popen([sys.executable, '-m', 'handover_dmp', *words])
    try:
        end = time.monotonic() + PATIENCE_S
        while not told.exists():
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)
        address = json.loads(told.read_text())['page']
        host, port = re.fullmatch(r'http://([\d.]+):(\d+)/handover\.html', address).groups()
        assert host == '127.0.0.1'
        assert urlopen(address).read().startswith(b'<!DOCTYPE html>')
        with pytest.raises(HTTPError):
            urlopen(f'http://{host}:{port}/')
        with socket.socket() as other:
            # Another address of this machine, where the page must not be.
            assert other.connect_ex(('127.0.0.2', int(port))) != 0
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0


def test_a_port_that_is_taken_is_said(
    runs: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = runs.write_run(tmp_path / 'run')
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert main(['view', str(folder), '--no-browser', '--port', port]) == 2
    error = capsys.readouterr().err
    assert port in error
    assert len(error.strip().splitlines()) == 1
