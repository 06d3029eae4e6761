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

import json

from handover_dmp.cli.main import main
import numpy as np
from PIL import Image
import pytest


def test_one_command_draws_it(tmp_path):
    picture = tmp_path / 'figure1.png'
    assert main(['figure1', '-o', str(picture), '--json', str(tmp_path / 'o.json')]) == 0
    pixels = np.asarray(Image.open(picture).convert('RGB'))
    assert min(pixels.shape[:2]) > 500
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 20
    outcome = json.loads((tmp_path / 'o.json').read_text())
    early, middle, late = np.array(outcome['positions_m'])
    # all arrive at the new goal, the one that lets go of the shape first is there first
    end = late[-1]
    assert [early[-1], middle[-1]] == pytest.approx([end, end], abs=5e-3)
    half = len(late) // 2
    assert abs(early[half] - end) < abs(middle[half] - end) < abs(late[half] - end)


def test_unknown_pictures_are_wrong_usage(tmp_path, capsys):
    assert main(['figure1', '-o', str(tmp_path / 'figure1.txt')]) == 2
    assert 'figure1.txt' in capsys.readouterr().err
