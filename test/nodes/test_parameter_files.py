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

"""Parameter files as users have them: what a node takes from one, and what `learn` does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
import re
import signal
import subprocess
import sys
from typing import Any

from handover_dmp.dmp.parameter_file import read_parameters
from handover_dmp.nodes.graph import isolate
import pytest
from rcl_interfaces.srv import GetParameters, ListParameters
import rclpy
from rclpy.parameter import parameter_value_to_python
import yaml

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


def start(node: str, *arguments: str) -> subprocess.Popen[str]:
    isolate()
    words = [sys.executable, '-m', f'handover_dmp.nodes.{node}', '--ros-args', *arguments]
    return subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def write(path: Path, tree: dict[str, Any]) -> Path:
    path.write_text(yaml.safe_dump(tree, sort_keys=False))
    return path


def ros(values: dict[str, Any]) -> dict[str, Any]:
    return {'ros__parameters': values}


@contextmanager
def asking(name: str) -> Iterator[Any]:
    """Give what asks a node for all its parameters, over its services, as `ros2 param` does."""
    rclpy.init(args=[])
    node = rclpy.create_node('asking', use_global_arguments=False)

    def ask(kind: Any, service: str, **fields: Any) -> Any:
        client = node.create_client(kind, f'{name}/{service}')
        assert client.wait_for_service(60.0)
        future = client.call_async(kind.Request(**fields))
        rclpy.spin_until_future_complete(node, future, timeout_sec=60.0)
        return future.result()

    def everything() -> dict[str, Any]:
        names = list(ask(ListParameters, 'list_parameters').result.names)
        values = ask(GetParameters, 'get_parameters', names=names).values
        return {
            key: parameter_value_to_python(value) for key, value in zip(names, values, strict=True)
        }

    try:
        yield everything
    finally:
        node.destroy_node()
        rclpy.shutdown()


def values_of(name: str, *arguments: str) -> dict[str, Any]:
    """Start a `dmp`, ask it for its parameters, end it."""
    process = start('dmp', *arguments)
    try:
        with asking(name) as ask:
            values: dict[str, Any] = ask()
    finally:
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    return values


MISSPELT = {
    'dmp': ({'dmp': ros({'stifness': 150.0})}, "/dmp: .*'stifness'; the nearest is 'stiffness'"),
    'priority_ik': ({'/**': ros({'postion_gain': 3.0})}, r"/\*\*: .*nearest is 'position_gain'"),
    'robot_sim': ({'/*/robot_sim': ros({'pace': 1.0}),
                   'robot_sim': ros({'initial_position': [0.0]})},
                  "/robot_sim: .*'initial_position'; the nearest is 'initial_positions'"),
}  # fmt: skip


@pytest.mark.parametrize('node', MISSPELT)
def test_a_misspelt_name_ends_the_node_with_one_line(tmp_path: Path, node: str) -> None:
    tree, message = MISSPELT[node]
    file = write(tmp_path / 'p.yaml', tree)
    process = start(node, '--params-file', str(file))
    said, complained = process.communicate(timeout=60)
    assert process.returncode == 2
    assert complained.count('\n') == 1, complained
    assert 'there is no parameter' in complained
    assert re.search(message, complained), complained
    assert said == ''


@pytest.mark.parametrize('word', ['stifness:=3.0', 'dmp:stifness:=3.0'])
def test_a_misspelt_single_parameter_ends_the_node_with_one_line(word: str) -> None:
    process = start('dmp', '-p', word)
    _, complained = process.communicate(timeout=60)
    assert process.returncode == 2
    assert complained.count('\n') == 1, complained
    assert "the nearest is 'stiffness'" in complained


def test_sections_for_all_and_for_one_are_merged_as_rcl_does(tmp_path: Path) -> None:
    """And `learn --parameters` gets from the file what the node gets."""
    tree = {
        '/**': ros({'stiffness': 150.0, 'mu': 0.5, 'goal_velocity_gain': 3.0}),
        '/dmp': ros({'mu': 0.6}),
        'dmp': ros({'sigma': 0.07}),
        '/other': {'dmp': ros({'stiffness': 7.0})},
        '/**/dmp': ros({'goal_velocity_gain': 3.5}),
    }
    file = write(tmp_path / 'p.yaml', tree)
    values = values_of('/dmp', '--params-file', str(file))
    expected = {'stiffness': 150.0, 'mu': 0.6, 'sigma': 0.07, 'goal_velocity_gain': 3.5}
    assert {name: values[name] for name in expected} == expected
    learnt = asdict(read_parameters(file).primitive)
    assert {name: learnt[name] for name in expected} == expected


def test_what_a_node_dumps_goes_in_again(tmp_path: Path) -> None:
    """As `ros2 param dump` writes it: all of them, nested at their dots, under the full name."""
    given = write(tmp_path / 'given.yaml', {'/**': ros({'stiffness': 150.0, 'mu': 0.6})})
    values = values_of('/lab/dmp', '-r', '__ns:=/lab', '--params-file', str(given))
    tree: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, (list, tuple)) and not value:
            continue
        *around, last = name.split('.')
        inner = tree
        for part in around:
            inner = inner.setdefault(part, {})
        inner[last] = (
            list(value) if hasattr(value, 'tolist') or isinstance(value, tuple) else value
        )
    dump = write(tmp_path / 'dump.yaml', {'/lab/dmp': ros(tree)})
    again = values_of('/lab/dmp', '-r', '__ns:=/lab', '--params-file', str(dump))
    assert again == values
    learnt = read_parameters(dump).primitive
    assert (learnt.stiffness, learnt.mu) == (150.0, 0.6)
