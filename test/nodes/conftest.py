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

"""The example, ready to be run on the graph; a ROS domain for every process of tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from handover_dmp.handover.scenario import make_scenario, Scenario
from handover_dmp.runs.folder import keep_inputs
import pytest

rclpy = pytest.importorskip('rclpy', reason='ROS 2 is not installed')

Prepare = Callable[..., tuple[Path, dict[str, dict[str, Any]]]]


@pytest.fixture(scope='session')
def scenario() -> Scenario:
    return make_scenario()


@pytest.fixture
def prepare(tmp_path: Path, scenario: Scenario) -> Prepare:
    """Make a run folder and the parameters of the five nodes for it."""
    from handover_dmp.nodes.run_graph import graph_parameters

    def make(*, lockstep: bool = True, **changes: dict[str, Any]) -> Any:
        keep_inputs(tmp_path, scenario)
        parameters = graph_parameters(tmp_path, scenario, {'by': 'a test'}, lockstep)
        for node, values in changes.items():
            parameters[node] |= values
        return tmp_path, parameters

    return make
