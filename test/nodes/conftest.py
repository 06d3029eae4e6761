"""The example, ready to be run on the graph; a ROS domain for every process of tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from handover_dmp.run import keep_inputs
from handover_dmp.scenario import make_scenario, Scenario
import pytest

rclpy = pytest.importorskip('rclpy', reason='ROS 2 is not installed')

Prepare = Callable[..., tuple[Path, dict[str, dict[str, Any]]]]


@pytest.fixture(scope='session')
def scenario() -> Scenario:
    return make_scenario()


@pytest.fixture
def prepare(tmp_path: Path, scenario: Scenario) -> Prepare:
    """Make a run folder and the parameters of the five nodes for it."""
    from handover_dmp.nodes.conduct import graph_parameters

    def make(*, lockstep: bool = True, **changes: dict[str, Any]) -> Any:
        keep_inputs(tmp_path, scenario)
        parameters = graph_parameters(tmp_path, scenario, {'by': 'a test'}, lockstep)
        for node, values in changes.items():
            parameters[node] |= values
        return tmp_path, parameters

    return make
