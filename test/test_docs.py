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

"""In README and docs every link leads somewhere and every table is up to date."""

from __future__ import annotations

from importlib import util
from pathlib import Path
import re
from types import ModuleType
from typing import Any

from handover_dmp.common.settings import defaults
from handover_dmp.topics import TOPICS
import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
NODES = (
    'robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder', 'velocity_to_position',
    'calibration_motion',
)  # fmt: skip
SERVICES = {
    '/hand_tracker/replay', '/dmp/start', '/dmp/abort', '/dmp/reset', '/robot_sim/pause',
    '/robot_sim/resume', '/robot_sim/reset', '/recorder/ready', '/velocity_to_position/resume',
    '/calibration_motion/start',
}  # fmt: skip


def test_services_that_are_told_of_are_those_of_the_nodes() -> None:
    served = set()
    for node in NODES:
        text = (ROOT / 'handover_dmp' / 'nodes' / f'{node}.py').read_text(encoding='utf-8')
        served |= {
            f'/{node}/{name}' for name in re.findall(r"self\.serve(?:_switch)?\('(\w+)'", text)
        }
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
        assert f'| `{topic.relative}` | `{topic.type_name}` |' in text


def test_a_changed_default_is_noticed(tables: ModuleType) -> None:
    text = (ROOT / 'docs' / 'parameters.md').read_text(encoding='utf-8')
    changed: Any = text.replace('| `stiffness` | `200` |', '| `stiffness` | `100` |')
    assert changed != text
    assert tables.filled(changed, tables.documents()['parameters.md']) == text


def test_pictures_of_the_readme_are_small_enough() -> None:
    for path in (ROOT / 'docs' / 'images').iterdir():
        assert path.stat().st_size < 3_000_000, path.name
