"""The launch file: checked by its syntax tree, and loaded where `launch` is installed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from handover_dmp.dmp import load_model
from handover_dmp.errors import HandoverError
from handover_dmp.hand import read_trial
from handover_dmp.settings import defaults
import numpy as np
import pytest

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


def dictionaries(tree: ast.AST, key: str) -> Iterator[ast.expr]:
    """Yield the values that stand under a key in the dictionaries of a syntax tree."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict):
            for name, value in zip(node.keys, node.values, strict=True):
                if isinstance(name, ast.Constant) and name.value == key:
                    yield value


def test_the_arguments(functions: dict[str, Any]) -> None:
    assert set(functions['ARGUMENTS']) >= ARGUMENTS
    for default, description in functions['ARGUMENTS'].values():
        assert isinstance(default, str)
        assert description


def test_every_argument_is_used(tree: ast.Module) -> None:
    words = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    for argument in ARGUMENTS:
        # Once where it is declared, and at least once where it is read.
        assert words.count(argument) >= 2, argument


def test_every_node_gets_parameters_that_it_has(tree: ast.Module) -> None:
    described = {
        # Without a default, so not in the file of defaults.
        'robot_sim': {'initial_positions'},
    }
    for node in NODES:
        (given,) = (value for value in dictionaries(tree, node))
        names = {word.value for word in ast.walk(given) if isinstance(word, ast.Constant)}
        parameters = {name for name in names if isinstance(name, str)} - {'bag', 'output', 'robot'}
        assert parameters <= set(defaults(node)) | described.get(node, set()), node


def test_executables_of_this_package_are_those_that_are_installed(
    functions: dict[str, Any], tree: ast.Module
) -> None:
    assert functions['PACKAGE'] == 'handover_dmp'
    for node in NODES:
        assert (ROOT / 'scripts' / node).is_file()
        assert list(dictionaries(tree, node))


def test_other_packages_are_those_that_package_xml_names_or_viewers(tree: ast.Module) -> None:
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    named = {element.text for element in root.findall('exec_depend')}
    packages = {
        keyword.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == 'package' and isinstance(keyword.value, ast.Constant)
    }
    assert packages - named == {'rviz2', 'foxglove_bridge'}


@pytest.mark.parametrize('exchange', ['give', 'take'])
def test_a_synthetic_handover_and_its_model_are_left_for_the_nodes(
    functions: dict[str, Any], tmp_path: Path, exchange: str
) -> None:
    chosen = {'trial': '', 'bag': '', 'exchange': exchange, 'robot': 'lwr4'}
    scenario, trial, model = functions['_scenario'](chosen, tmp_path)
    assert read_trial(Path(trial)).exchange == exchange
    learnt = load_model(Path(model))
    assert learnt.duration_s == scenario.model.duration_s
    np.testing.assert_allclose(
        scenario.robot.wrist_pose(scenario.start_posture)[0], scenario.trial.p2[0], atol=1e-3
    )


def test_a_trial_of_the_users_own(
    functions: dict[str, Any], tmp_path: Path, kth_folder: Path
) -> None:
    trial = str(sorted(kth_folder.glob('raw_*.csv'))[0])
    chosen = {'trial': trial, 'bag': '', 'exchange': 'give', 'robot': 'lwr4'}
    _, named, model = functions['_scenario'](chosen, tmp_path)
    assert named == trial
    assert load_model(Path(model)).duration_s > 0.0


def test_what_is_wrong_is_said(functions: dict[str, Any], tmp_path: Path) -> None:
    chosen = {'trial': '', 'bag': '', 'exchange': 'throw', 'robot': 'lwr4'}
    with pytest.raises(RuntimeError, match='throw'):
        functions['_scenario'](chosen, tmp_path)
    with pytest.raises(HandoverError, match=r'none\.csv'):
        functions['_scenario']({**chosen, 'trial': str(tmp_path / 'none.csv')}, tmp_path)


def test_the_output_folder(
    functions: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made = functions['_output']('')
    assert made.is_dir()
    assert made.parent == tmp_path / 'runs'
    assert functions['_output'](str(tmp_path / 'here')) == tmp_path / 'here'


def test_the_root_link(functions: dict[str, Any]) -> None:
    text = (ROOT / 'urdf' / 'lwr4.urdf').read_text(encoding='utf-8')
    assert functions['_root_link'](text) == 'lwr4_base'


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
