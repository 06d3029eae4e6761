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

"""The launch file: checked by its syntax tree, and loaded where `launch` is installed."""

from __future__ import annotations

from array import array
import ast
from importlib.util import module_from_spec, spec_from_file_location
import json
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree

from handover_dmp.common.errors import HandoverError
from handover_dmp.common.settings import defaults
from handover_dmp.dmp import load_model
from handover_dmp.mocap import read_trial
from handover_dmp.robot.model import BasePlacement, RobotModel
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
LAUNCH = ROOT / 'launch' / 'handover.launch.py'
NODES = {'robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder'}
ARGUMENTS = {'robot', 'trial', 'bag', 'exchange', 'use_sim_time', 'record', 'rviz', 'foxglove'}


@pytest.fixture(scope='module')
def tree() -> ast.Module:
    """Parse the launch file."""
    return ast.parse(LAUNCH.read_text(encoding='utf-8'), str(LAUNCH))


@pytest.fixture(scope='module')
def functions(tree: ast.Module) -> dict[str, Any]:
    """Load all of the launch file but its imports of `launch`, which not every machine has."""
    kept = [
        node
        for node in tree.body
        if not (isinstance(node, ast.ImportFrom) and str(node.module).startswith('launch'))
    ]
    names: dict[str, Any] = {}
    exec(compile(ast.Module(kept, type_ignores=[]), str(LAUNCH), 'exec'), names)
    return names


def test_the_arguments(functions: dict[str, Any]) -> None:
    assert set(functions['ARGUMENTS']) >= ARGUMENTS
    for default, description, choices in functions['ARGUMENTS'].values():
        assert isinstance(default, str)
        assert description
        assert choices is None or default in choices


def test_every_argument_is_used(tree: ast.Module) -> None:
    words = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    for argument in ARGUMENTS:
        # Once where it is declared, and at least once where it is read.
        assert words.count(argument) >= 2, argument


def test_other_packages_are_those_that_package_xml_names(tree: ast.Module) -> None:
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    named = {element.text for element in root.findall('exec_depend')}
    packages = {
        keyword.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == 'package' and isinstance(keyword.value, ast.Constant)
    }
    assert {'rviz2', 'foxglove_bridge'} <= packages <= named | {'handover_dmp'}


def choose(functions: dict[str, Any], **chosen: str) -> dict[str, str]:
    """Return the value of every launch argument."""
    return {name: default for name, (default, _, _) in functions['ARGUMENTS'].items()} | chosen


def sections(file: Path) -> dict[str, dict[str, Any]]:
    """Read a file of parameters: node to name to value."""
    read = yaml.safe_load(file.read_text(encoding='utf-8'))
    return {
        section.removeprefix('/**/'): values['ros__parameters'] for section, values in read.items()
    }


@pytest.mark.parametrize('section', ['/**', '/**/dmp', 'dmp', '/left/dmp'])
def test_the_viewers_follow_the_frame(
    functions: dict[str, Any], tmp_path: Path, section: str
) -> None:
    told = tmp_path / 'told.yaml'
    told.write_text(yaml.safe_dump({section: {'ros__parameters': {'frame': 'room'}}}))
    space = 'left' if 'left' in section else ''
    frame = functions['frame_of'](choose(functions, parameters=str(told), namespace=space))
    assert frame == 'room'
    functions['write_layout'](tmp_path, frame)
    layout = json.loads((tmp_path / 'handover.foxglove.json').read_text(encoding='utf-8'))
    scene = layout['configById']['3D!scene']
    assert scene['followTf'] == scene['layers']['grid']['frameId'] == 'room'
    assert '"world"' not in json.dumps(layout)


def test_the_usual_frame_needs_no_layout(functions: dict[str, Any], tmp_path: Path) -> None:
    assert functions['frame_of'](choose(functions)) == 'world'
    functions['write_layout'](tmp_path, 'world')
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize('direction', ['give', 'take'])
@pytest.mark.parametrize('use_sim_time', ['true', 'false'])
def test_a_synthetic_handover_is_left_for_the_nodes(
    functions: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    direction: str,
    use_sim_time: str,
) -> None:
    pytest.importorskip('rclpy')
    monkeypatch.chdir(tmp_path)
    chosen = choose(functions, exchange=direction, use_sim_time=use_sim_time)
    file = functions['prepare'](chosen)
    parameters = sections(file)
    assert set(parameters) == NODES
    trial = read_trial(Path(parameters['hand_tracker']['trial']))
    assert load_model(Path(parameters['dmp']['model'])).duration_s > 0.0
    arm = parameters['robot_sim']
    base = BasePlacement(tuple(arm['base_position']), yaw=arm['base_yaw'])
    wrist, _ = RobotModel.load(arm['robot'], base=base).wrist_pose(
        np.array(arm['initial_positions'])
    )
    np.testing.assert_allclose(wrist, trial.demonstrator[0], atol=0.01)
    bag = Path(parameters['recorder']['folder'])
    assert bag.parent.parent == tmp_path / 'runs'
    assert bag.parent.name.endswith(f'_{direction}_engine_bay')
    assert not bag.exists()
    for name, own in parameters.items():
        assert own['lockstep'] is (use_sim_time == 'true')
        assert own['use_sim_time'] is (use_sim_time == 'true' and name != 'robot_sim')


def test_every_node_gets_parameters_that_it_has(functions: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    file = functions['prepare'](choose(functions, output=str(tmp_path / 'run')))
    parameters = sections(file)
    # Of rclpy; and without a default, so not in the file of defaults.
    others = {'use_sim_time', 'initial_positions'}
    for node, own in parameters.items():
        assert set(own) <= set(defaults(node)) | others, node


class Context:
    """Gives every substitution of the launch file its default, where `launch` is not installed."""

    def __init__(self, functions: dict[str, Any], **chosen: str) -> None:
        self.values = choose(functions, **chosen)


class Configuration:
    """What the launch file asks of `LaunchConfiguration`."""

    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context: Context) -> str:
        return context.values[self.name]


def node_actions(functions: dict[str, Any], **chosen: str) -> list[dict[str, Any]]:
    """Return what the launch file gives to each `Node`."""
    functions |= {
        'LaunchConfiguration': Configuration,
        'Node': lambda **given: given,
        **dict.fromkeys(('IfCondition', 'OrSubstitution', 'Shutdown'), lambda *_, **__: None),
    }
    actions: list[dict[str, Any]] = functions['nodes'](Context(functions, **chosen))
    return actions


def ros_arguments(action: dict[str, Any], folder: Path) -> list[str]:
    """Write the command line as launch_ros does: name, namespace, parameters in their order."""
    name, namespace = action['name'], action.get('namespace')
    words = ['--ros-args', '-r', f'__node:={name}']
    if namespace is not None:
        words += ['-r', f'__ns:={namespace}']
    for k, given in enumerate(action['parameters']):
        file = given
        if isinstance(given, dict):
            # launch_ros (Jazzy), Node._create_params_file_from_dict
            key = '/**' if namespace is None else f'{namespace.rstrip("/")}/{name}'
            file = folder / f'{name}_{k}.yaml'
            file.write_text(yaml.dump({key: {'ros__parameters': given}}), encoding='utf-8')
        words += ['--params-file', str(file)]
    return words


@pytest.mark.ros
@pytest.mark.timeout(300)
def test_the_nodes_take_what_the_launch_file_gives_them(
    functions: dict[str, Any], tmp_path: Path
) -> None:
    """The files name the same nodes, so the later one wins; seen from another process."""
    rclpy = pytest.importorskip('rclpy')
    from handover_dmp.nodes.graph import isolate
    from handover_dmp.nodes.parameters import unquoted
    from rclpy.parameter import parameter_value_to_python
    from rclpy.parameter_client import AsyncParameterClient

    isolate()
    output = tmp_path / 'run'
    actions = node_actions(functions, direction='take', output=str(output))
    own = sections(output / 'parameters.yaml')
    assert own['recorder']['folder'] == str(output / 'bag')
    processes = []
    rclpy.init(args=[])
    try:
        for action in actions:
            if action['package'] == 'handover_dmp':
                node = f'handover_dmp.nodes.{action["executable"]}'
                words = [sys.executable, '-m', node, *ros_arguments(action, tmp_path)]
                processes.append(subprocess.Popen(words))
        assert len(processes) == len(NODES)
        look = rclpy.create_node('look')
        for name, expected in own.items():
            client = AsyncParameterClient(look, f'/{name}')
            assert client.wait_for_services(60.0), name
            asked = client.get_parameters(list(expected))
            rclpy.spin_until_future_complete(look, asked, timeout_sec=60.0)
            values = [parameter_value_to_python(value) for value in asked.result().values]
            plain = [list(v) if isinstance(v, array) else v for v in values]
            # a text that looks like YAML is kept in quotes, so that a dump can be loaded
            assert [unquoted(v) if isinstance(v, str) else v for v in plain] == [
                *expected.values()
            ]
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        assert [process.wait(60) for process in processes] == [0] * len(processes)
        rclpy.try_shutdown()


def test_a_trial_of_the_users_own(
    functions: dict[str, Any], tmp_path: Path, kth_folder: Path
) -> None:
    pytest.importorskip('rclpy')
    trial = sorted(kth_folder.rglob('raw_*.csv'))[0]
    chosen = choose(functions, trial=str(trial), output=str(tmp_path / 'run'))
    file = functions['prepare'](chosen)
    kept = read_trial(Path(sections(file)['hand_tracker']['trial']))
    assert kept.duration_s == pytest.approx(read_trial(trial).duration_s, abs=0.05)


@pytest.mark.parametrize(
    ('chosen', 'error', 'words'),
    [
        ({'trial': 'a.csv', 'bag': 'b'}, RuntimeError, 'exclude'),
        ({'from': '1.0'}, RuntimeError, 'from and to must be given together'),
        ({'bag': 'b', 'from': '2', 'to': '1'}, RuntimeError, 'to must be later than from'),
        ({'bag': 'b', 'from': 'x', 'to': '1'}, RuntimeError, 'expected two times'),
        ({'trial': '/none.csv'}, HandoverError, r'none\.csv'),
        ({'robot': '/none.urdf'}, HandoverError, r'none\.urdf'),
    ],
)
def test_what_is_wrong_is_said(
    functions: dict[str, Any],
    tmp_path: Path,
    chosen: dict[str, str],
    error: type[Exception],
    words: str,
) -> None:
    pytest.importorskip('rclpy')
    output = tmp_path / 'run'
    with pytest.raises(error, match=words):
        functions['prepare'](choose(functions, output=str(output), **chosen))
    assert not output.exists()


def test_rviz_is_told_what_the_links_of_an_arm_in_a_namespace_are_called(
    functions: dict[str, Any], tmp_path: Path
) -> None:
    rviz = ROOT / 'config' / 'handover.rviz'
    for none in ('', '/'):
        assert functions['rviz_file'](tmp_path, none).samefile(rviz)
    own = functions['rviz_file'](tmp_path, '/left')
    assert own.parent == tmp_path
    was, now = (yaml.safe_load(f.read_text(encoding='utf-8')) for f in (rviz, own))
    arm = next(
        d for d in now['Visualization Manager']['Displays'] if d['Class'].endswith('RobotModel')
    )
    assert arm['TF Prefix'] == 'left'
    arm['TF Prefix'] = ''
    assert now == was


def test_launch_loads_it_where_it_is_installed() -> None:
    pytest.importorskip('launch_ros')
    from launch import LaunchContext
    from launch.actions import DeclareLaunchArgument

    spec = spec_from_file_location('handover_launch', LAUNCH)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    description = module.generate_launch_description()
    declared = {
        entity.name for entity in description.entities if isinstance(entity, DeclareLaunchArgument)
    }
    assert declared >= ARGUMENTS
    context = LaunchContext()
    for entity in description.entities:
        if isinstance(entity, DeclareLaunchArgument):
            entity.execute(context)
    actions = module.nodes(context)
    assert {action.node_executable for action in actions} >= NODES
