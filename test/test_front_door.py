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

from pathlib import Path
import re
import subprocess
import sys

import handover_dmp
from handover_dmp import (
    Basis,
    GoalEstimator,
    learn_from_trials,
    PriorityIk,
    RobotModel,
    synthesize,
)
import pytest

README = Path(__file__).resolve().parents[1] / 'README.md'


def test_every_public_name_is_there() -> None:
    assert dir(handover_dmp) == sorted(handover_dmp.__all__)
    for name in handover_dmp.__all__:
        assert getattr(handover_dmp, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = handover_dmp.nothing


def test_the_package_itself_imports_nothing_heavy() -> None:
    program = 'import handover_dmp, sys; print("numpy" in sys.modules)'
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, check=True)
    assert done.stdout.strip() == b'False'


def test_a_thing_says_in_a_line_what_it_is() -> None:
    trial = synthesize()[0]
    model = learn_from_trials([trial])
    arm = RobotModel.load('lwr4')
    ik = PriorityIk(arm, self_collision=False)
    for thing in (trial, model, model.basis, model.covariance[0], arm, ik, GoalEstimator()):
        text = repr(thing)
        assert re.fullmatch(rf'{type(thing).__name__}\(.{{3,140}}\)', text), text
    assert repr(Basis([0.5, 1.0], [10.0, 10.0])) == 'Basis(2 functions)'


def test_the_python_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r'```python\n(.*?)```', README.read_text(encoding='utf-8'), re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 6
    exec(code, {})
    assert float(re.search(r'([\d.]+) mm', capsys.readouterr().out)[1]) < 100.0
