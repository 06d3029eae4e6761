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

"""What a user does first with an arm of their own."""

from __future__ import annotations

import json
from pathlib import Path

from handover_dmp.cli.main import main
from handover_dmp.common.resources import share_path
import numpy as np
from PIL import Image
import pytest


def test_an_arm_is_looked_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = tmp_path / 'mine.urdf'
    text = share_path('urdf/lwr4.urdf').read_text(encoding='utf-8')
    arm.write_text(text.replace('robot name="lwr4"', 'robot name="mine"'), encoding='utf-8')
    picture, numbers = tmp_path / 'mine.png', tmp_path / 'mine.json'
    assert main(['robot', str(arm), '-o', str(picture), '--json', str(numbers)]) == 0
    shown = capsys.readouterr().out
    assert 'joint_7' in shown and 'acceleration: default' in ' '.join(shown.split())
    told = json.loads(numbers.read_text())
    assert [joint['name'] for joint in told['joints']] == [f'joint_{i}' for i in range(1, 8)]
    assert told['joints'][0]['velocity'] == pytest.approx(np.radians(100.0), rel=1e-6)
    assert told['limit_sources']['velocity'] == 'description'
    assert told['wrist_frame'] == 'wrist' and told['engines_apart_m'] < 1e-6
    assert 0.7 < told['reach_m'] < 1.0
    pixels = np.asarray(Image.open(picture).convert('L'))
    seen = pixels != pixels[0, 0]
    # the arm is in the picture, and none of it beyond its edge
    assert 0.03 < seen.mean() < 0.6
    assert not (seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any())


def test_an_arm_that_cannot_be_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = tmp_path / 'mine.urdf'
    arm.write_text('<robot name="mine"><link name="base"/></robot>', encoding='utf-8')
    assert main(['robot', str(arm)]) == 1
    assert capsys.readouterr().err == (
        f'handover_dmp robot: {arm}: no joint moves any link; is it an arm?\n'
    )
