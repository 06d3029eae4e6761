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

"""
Every command in README and docs works, every link leads somewhere, every table is up to date.

Commands are the lines of the shell blocks. Those that are quick are run, in order, in one folder
with the files that a reader is assumed to have. The others are checked in the way that `CHECKS`
says; a command that nothing here knows is a failure.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import import_module, util
from itertools import pairwise
from pathlib import Path
import re
import shlex
import subprocess
import sys
from types import ModuleType
from typing import Any

from handover_dmp.cli.main import VERBS
from handover_dmp.dmp import DmpParameters
from handover_dmp.hand import synthesize, write_trial
from handover_dmp.parameter_file import TunedParameters, write_parameters
from handover_dmp.settings import defaults
from handover_dmp.topics import TOPICS
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
NODES = ('robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder')
SERVICES = {
    '/hand_tracker/replay', '/dmp/start', '/dmp/abort', '/dmp/reset', '/robot_sim/pause',
    '/robot_sim/resume', '/robot_sim/reset',
}  # fmt: skip
# These are run. Of the others only the words are checked, since they take minutes, wait for a
# browser, or start ROS, and have tests of their own; so has every robot.
RUN = ('synthesize', 'learn', 'rollout', 'import', 'simulate', 'plot', 'bag')


def commands(path: Path) -> list[str]:
    """Return the lines of the shell blocks of a document, without comments."""
    text = path.read_text(encoding='utf-8')
    lines: list[str] = []
    for block in re.findall(r'^```(?:sh|bash|shell|console)\n(.*?)^```', text, re.M | re.S):
        lines += block.replace('\\\n', ' ').splitlines()
    # CONTRIBUTING and others indent theirs.
    indented = re.findall(
        r'^    ((?:make|\.venv/bin/\S+|handover_dmp|ros2|colcon)\s.*)$', text, re.M
    )
    words = [re.sub(r'\s#\s.*$', '', line).strip() for line in lines + indented]
    return [word for word in words if word and not word.startswith('#')]


ALL = [(path.relative_to(ROOT).as_posix(), line) for path in DOCUMENTS for line in commands(path)]


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with the files that the documents speak of as the reader's own."""
    folder = tmp_path_factory.mktemp('reader')
    trial = next(trial for trial in synthesize(trials=1) if trial.exchange == 'take')
    write_trial(trial, folder / 'my_trial.csv')
    urdf = (ROOT / 'urdf' / 'lwr4.urdf').read_text(encoding='utf-8')
    (folder / 'my_arm.urdf').write_text(urdf, encoding='utf-8')
    # What `tune` writes.
    write_parameters(TunedParameters(DmpParameters(), 1.0), folder / 'tuned.yaml', 'tuned')
    (folder / 'recording.tsv').write_text(qualisys(trial.p1, trial.p2), encoding='utf-8')
    rest = np.repeat(trial.p1[:1], 200, axis=0), np.repeat(trial.p2[:1], 200, axis=0)
    there_and_back = [
        np.vstack([a, p, p[::-1], a]) for a, p in zip(rest, (trial.p1, trial.p2), strict=True)
    ]
    (folder / 'session.tsv').write_text(qualisys(*there_and_back), encoding='utf-8')
    return folder


def qualisys(p1: np.ndarray, p2: np.ndarray) -> str:
    """Write two markers as Qualisys Track Manager does."""
    lines = [
        f'NO_OF_FRAMES\t{len(p1)}', 'NO_OF_MARKERS\t2', 'FREQUENCY\t200', 'DATA_INCLUDED\t3D',
        'MARKER_NAMES\tM_wrist\tA_wrist',
    ]  # fmt: skip
    rows = 1000.0 * np.hstack([p1, p2])
    return '\n'.join([*lines, *('\t'.join(f'{x:.3f}' for x in row) for row in rows)]) + '\n'


@pytest.mark.timeout(1800)  # a verb on a machine that does much else
@pytest.mark.parametrize(('document', 'line'), ALL, ids=[f'{d}: {c[:50]}' for d, c in ALL])
def test_every_command(document: str, line: str, folder: Path) -> None:
    words = shlex.split(line)
    name = words[0].removeprefix('.venv/bin/')
    assert name in CHECKS, f'{document}: nothing here knows how to check {line!r}'
    CHECKS[name](words[1:], folder)


def check_own(words: list[str], folder: Path) -> None:
    """Run a verb, or let it parse its words."""
    if words in (['--help'], ['--version']):
        run([sys.executable, '-m', 'handover_dmp', *words], folder)
        return
    verb, *rest = words
    assert verb in VERBS
    module = import_module(f'handover_dmp.cli.{"import_verb" if verb == "import" else verb}')
    parser = argparse.ArgumentParser()
    module.add_arguments(parser)
    parser.parse_args(rest)
    if verb in RUN and '--robot' not in rest:
        run([sys.executable, '-m', 'handover_dmp', *words], folder)


def check_python(words: list[str], folder: Path) -> None:
    """Look for the script or module; scripts are run by tests of their own."""
    if words[0] == '-m':
        assert util.find_spec(words[1]) is not None
    else:
        assert (ROOT / words[0]).is_file(), words[0]
    check_ros_arguments(words[1:], '')


def check_make(words: list[str], _folder: Path) -> None:
    """Look for the targets."""
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    for word in words:
        if re.fullmatch(r'[\w-]+', word):
            assert re.search(rf'^{word}:', makefile, re.M), f'make {word}'


def check_ros2(words: list[str], folder: Path) -> None:
    """Compare with launch arguments, nodes, parameters, services, topics of this package."""
    match words:
        case ['launch', 'handover_dmp', file, *given]:
            arguments = launch_arguments()
            assert (ROOT / 'launch' / file).is_file()
            assert {word.partition(':=')[0] for word in given} <= arguments
        case ['run', 'handover_dmp', node, *rest]:
            assert node in NODES
            check_ros_arguments(rest, node)
        case ['service', 'call', service, kind]:
            assert service in SERVICES
            assert kind == 'std_srvs/srv/Trigger'
        case ['param', 'describe' | 'set', node, name, *_]:
            assert name in parameters(node.removeprefix('/'))
        case ['topic', 'echo' | 'hz' | 'info', topic]:
            assert topic in {known.name for known in TOPICS}
        case ['bag', 'play' | 'info', bag]:
            # One that an earlier command has made; its form has tests of its own.
            assert (folder / bag / 'metadata.yaml').is_file()
        case ['security', 'create_keystore' | 'create_enclave', *_]:
            pass  # of SROS 2, which is not of this package
        case _:
            pytest.fail(f'ros2 {" ".join(words)}: unknown here')


def check_ros_arguments(words: list[str], node: str) -> None:
    """Look for every parameter and every topic that is remapped."""
    for flag, value in pairwise(words):
        name = value.partition(':=')[0]
        if flag == '-p':
            assert name in parameters(node), f'{node} has no parameter {name}'
        elif flag == '-r' and not name.startswith('/velocity_to_position/'):
            assert name in {topic.name for topic in TOPICS}, f'no topic {name}'


def check_shell(words: list[str], _folder: Path) -> None:
    """Look at the variables that are set."""
    for word in words:
        name, equals, _ = word.partition('=')
        assert equals
        assert name.startswith('ROS_') or name in ('FASTRTPS_DEFAULT_PROFILES_FILE',)


def check_colcon(words: list[str], _folder: Path) -> None:
    """Test_packaging.py builds and tests with it."""
    assert words[0] in ('build', 'test', 'test-result')


def ignore(_words: list[str], _folder: Path) -> None:
    """Change folder or environment: nothing to check."""


CHECKS: dict[str, Callable[[list[str], Path], None]] = {
    'handover_dmp': check_own,
    'python': check_python,
    'make': check_make,
    'ros2': check_ros2,
    'export': check_shell,
    'colcon': check_colcon,
    '.': ignore,
    'source': ignore,
    'cd': ignore,
}


def run(words: list[str], folder: Path) -> None:
    """Run a command in the reader's folder; it must succeed."""
    result = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def launch_arguments() -> set[str]:
    """Return the names of the arguments of the launch file."""
    text = (ROOT / 'launch' / 'handover.launch.py').read_text(encoding='utf-8')
    table = re.search(r'^ARGUMENTS = \{(.*?)^\}', text, re.M | re.S)[1]
    return set(re.findall(r"^    '(\w+)':", table, re.M))


def parameters(node: str) -> set[str]:
    """Return the names of the parameters of a node."""
    return {*defaults(node), 'initial_positions'} if node in NODES else set()


def test_the_documents_have_commands() -> None:
    assert len(ALL) > 25
    assert {'README.md', 'docs/parameters.md', 'docs/topics.md'} <= {name for name, _ in ALL}


def test_readme_begins_with_the_two_commands() -> None:
    assert commands(ROOT / 'README.md')[:2] == ['make demo', 'make test']


def test_services_that_are_told_of_are_those_of_the_nodes() -> None:
    served = set()
    for node in NODES:
        text = (ROOT / 'handover_dmp' / 'nodes' / f'{node}.py').read_text(encoding='utf-8')
        served |= {f'/{node}/{name}' for name in re.findall(r"self\.serve\('(\w+)'", text)}
    assert served == SERVICES
    told = (ROOT / 'docs' / 'topics.md').read_text(encoding='utf-8')
    assert set(re.findall(r'^\| `(/\w+/\w+)` \| [a-z]', told, re.M)) >= SERVICES


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    text = path.read_text(encoding='utf-8')
    headings = {
        re.sub(r'[^\w -]', '', heading).strip().lower().replace(' ', '-')
        for heading in re.findall(r'^#+ (.*)$', text, re.M)
    }
    for target in re.findall(r'\]\(([^)\s]+)\)', text):
        if target.startswith('#'):
            assert target[1:] in headings, target
        elif not re.match(r'\w+:', target):
            assert (path.parent / target.partition('#')[0]).exists(), f'{path.name}: {target}'


def test_code_that_method_names_exists() -> None:
    text = (ROOT / 'docs' / 'method.md').read_text(encoding='utf-8')
    named = set(re.findall(r'`([\w/]+\.py)`', text))
    assert len(named) > 10
    for name in named:
        assert (ROOT / 'handover_dmp' / name).is_file(), name


@pytest.fixture(scope='module')
def tables() -> ModuleType:
    """Give the tool that writes the tables."""
    pytest.importorskip('rclpy')
    spec = util.spec_from_file_location('write_docs', ROOT / 'scripts' / 'write_docs.py')
    assert spec is not None
    assert spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_tables_are_those_of_the_code(tables: ModuleType) -> None:
    for file, parts in tables.documents().items():
        text = (ROOT / 'docs' / file).read_text(encoding='utf-8')
        assert text == tables.filled(text, parts), f'{file}: python scripts/write_docs.py'


def test_every_parameter_and_topic_is_in_the_tables() -> None:
    text = (ROOT / 'docs' / 'parameters.md').read_text(encoding='utf-8')
    for node in NODES:
        for name in defaults(node):
            assert f'`{name}`' in text, f'{node}: {name}'
    text = (ROOT / 'docs' / 'topics.md').read_text(encoding='utf-8')
    for topic in TOPICS:
        assert f'| `{topic.name}` | `{topic.type_name}` |' in text


def test_a_changed_default_is_noticed(tables: ModuleType) -> None:
    text = (ROOT / 'docs' / 'parameters.md').read_text(encoding='utf-8')
    changed: Any = text.replace('| `stiffness` | `200` |', '| `stiffness` | `100` |')
    assert changed != text
    assert tables.filled(changed, tables.documents()['parameters.md']) == text


def test_pictures_of_the_readme_are_small_enough() -> None:
    for path in (ROOT / 'docs' / 'images').iterdir():
        assert path.stat().st_size < 3_000_000, path.name
