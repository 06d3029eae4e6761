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
Write the tables of the documents; with --check, only compare them.

The tables of docs/parameters.md and docs/topics.md come from the code, those of docs/benchmarks.md
and the README from the JSON files of `handover_dmp bench` in docs/.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator, Sequence
from importlib import import_module
import json
from pathlib import Path
import re
import sys
from typing import Any

from handover_dmp import topics
from handover_dmp.bench.measurement import Measurement
from handover_dmp.bench.report import cells, markdown, read_json
from handover_dmp.common.settings import ANYWHERE, defaults
from handover_dmp.nodes.parameters import ARM, COMMON, DRIVER, Parameter
from handover_dmp.nodes.tracker_parameters import HAND
from handover_dmp.topics import Topic, TOPICS

ROOT = Path(__file__).resolve().parents[1]
NODES = (
    'hand_tracker', 'dmp', 'priority_ik', 'robot_sim', 'recorder', 'velocity_to_position',
    'calibration_motion',
)  # fmt: skip
# Helper modules with topics, and the nodes that use them.
HELPERS = {
    'markers': 'dmp', 'diagnostics': 'every node', 'hand_input': '`dmp`, `priority_ik`',
    'object_topics': 'robot_sim', 'gripper': 'dmp', 'wrench_input': 'dmp',
    'transforms': '`robot_sim`, or `recorder` into the bag',
}  # fmt: skip
# These are compared with other timers, not with other libraries.
OF_TIMERS = ('period error', 'hand pose to joint velocity', 'five ')
BEGIN, END = '<!-- generated: {} -->', '<!-- end -->'


def main() -> int:
    """Write or check the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--check', action='store_true', help='exit 1 if a table is out of date')
    check = parser.parse_args().check
    stale = []
    for file, parts in documents().items():
        path = ROOT / 'docs' / file
        old = path.read_text(encoding='utf-8')
        new = filled(old, parts)
        if new != old:
            stale.append(path)
            if not check:
                path.write_text(new, encoding='utf-8')
    for path in stale:
        print(f'{path}: {"out of date: python scripts/write_docs.py" if check else "written"}')
    return int(check and bool(stale))


def documents() -> dict[str, dict[str, str]]:
    """Return the generated parts of each document, by their names."""
    parameters = {'every node': parameter_table('', COMMON)}
    for name in NODES:
        parameters[name] = parameter_table(name, [*own_parameters(name), *other_defaults(name)])
    parameters['primitive'] = parameter_table('dmp', module('dmp').PRIMITIVE)
    parameters['settings'] = settings_table()
    figures = ROOT / 'docs' / 'benchmarks.json'
    measured = read_json(figures)
    beside_placo = [r for r in read_json(ROOT / 'docs' / 'benchmarks_placo.json') if r.peers]
    return {
        'parameters.md': parameters,
        'topics.md': {'topics': topic_table()},
        'benchmarks.md': {
            'figures': markdown(measured) + machine_line(figures),
            'placo': markdown(beside_placo),
        },
        '../README.md': {'benchmark': benchmark_table(measured)},
    }


def machine_line(figures: Path) -> str:
    """Name the machine and the versions of the figures."""
    told = json.loads(figures.read_text(encoding='utf-8'))['machine']
    versions = ', '.join(f'{name} {number}' for name, number in told['versions'].items())
    return (
        f'\n{told["processor"]}, {told["cores"]} cores, load {told["load"]} at the start; '
        f'Python {told["python"]}; {versions}; {told["date"][:10]}.\n'
    )


def benchmark_table(results: Sequence[Measurement]) -> str:
    """Select the rows with a target and other libraries, without notes."""
    beside = [r for r in results if r.peers and r.target and not r.name.startswith(OF_TIMERS)]
    rows = [
        (what, here, floor, peers.replace('\n', ', '))
        for what, here, _, floor, peers, _ in map(cells, beside)
    ]
    return table(('what', 'here', 'floor', 'others'), rows)


def filled(text: str, parts: dict[str, str]) -> str:
    """Insert the parts between their marks; marks and parts must correspond."""
    for name, part in parts.items():
        begin = BEGIN.format(name)
        if text.count(begin) != 1:
            raise SystemExit(f'{begin} must occur exactly once')
        before, _, rest = text.partition(begin)
        _, end, after = rest.partition(END)
        if not end:
            raise SystemExit(f'{begin} has no {END}')
        text = f'{before}{begin}\n{part}{END}{after}'
    return text


def module(node: str) -> Any:
    """Import the module of a node."""
    return import_module(f'handover_dmp.nodes.{node}')


def own_parameters(node: str) -> Sequence[Parameter]:
    """Return the parameters of a node beyond those of all nodes."""
    classes = [
        value for value in vars(module(node)).values() if getattr(value, 'NAME', None) == node
    ]
    # its default comes from the robot
    return (*classes[0].PARAMETERS, *getattr(module(node), 'POSTURE', ()))


def other_defaults(node: str) -> Sequence[Parameter]:
    """Return the parameters of all nodes whose default differs in this one."""
    usual, here = defaults('dmp'), defaults(node)
    return [parameter for parameter in COMMON if here[parameter.name] != usual[parameter.name]]


def parameter_table(node: str, parameters: Sequence[Parameter]) -> str:
    """Write one table."""
    known = defaults(node or 'dmp')
    rows = []
    for parameter in parameters:
        default = known.get(parameter.name)
        if parameter.choices:
            allowed = ', '.join(f'`{choice}`' for choice in parameter.choices)
        elif parameter.low is not None and parameter.high is not None:
            allowed = f'{number(parameter.low)} to {number(parameter.high)}'
        else:
            allowed = kind(default)
        when = 'at the start' if parameter.read_only else 'any time'
        rows.append((f'`{parameter.name}`', shown(default), allowed, when, parameter.description))
    return table(('parameter', 'default', 'values', 'set', 'meaning'), rows)


def settings_table() -> str:
    """List the entries of `config/handover.yaml` that are not parameters of a node."""
    rows = []
    comments = dict(yaml_comments())
    everywhere = {parameter.name for parameter in (*ARM, *DRIVER, *HAND)}
    for node in NODES:
        declared = {parameter.name for parameter in (*COMMON, *own_parameters(node))}
        if node == 'dmp':
            declared |= {parameter.name for parameter in module('dmp').PRIMITIVE}
        for name, value in defaults(node).items():
            if name not in declared | everywhere:
                meaning = comments[node, name]
                meaning = meaning[:1].upper() + meaning[1:]
                rows.append((f'`{node}`', f'`{name}`', shown(value), meaning))
    return table(('section', 'setting', 'default', 'meaning'), rows)


def yaml_comments() -> Iterator[tuple[tuple[str, str], str]]:
    """Read the comments at the ends of the lines of `config/handover.yaml`."""
    section, path = '', []
    text = (ROOT / 'config' / 'handover.yaml').read_text(encoding='utf-8')
    for line in text.splitlines():
        match = re.match(r'( *)([\w/*]+):(?: +([^#]*))?(?:#\s*(.*))?$', line)
        if match is None:
            continue
        depth, key = len(match[1]) // 2, match[2]
        if depth == 0:
            section = key.removeprefix(ANYWHERE)
        path = [*path[:depth], key]
        if (match[3] or '').strip():
            yield (section, '.'.join(path[2:])), match[4] or ''


def topic_table() -> str:
    """Write the table of topics."""
    published, subscribed = ends('advertise'), ends('subscribe')
    rows = []
    for topic in TOPICS:
        reliability, durability, depth = topic.quality.value
        quality = f'{reliability.replace("_", " ")}, {durability.replace("_", " ")}, {depth}'
        rows.append(
            (
                f'`{topic.relative}`', f'`{topic.type_name}`', quality,
                ', '.join(published.get(topic, ['`recorder`, into the bag'])),
                ', '.join(subscribed.get(topic, [])) or '–', topic.meaning,
            )
        )  # fmt: skip
    return table(('topic', 'type', 'quality of service', 'from', 'to', 'meaning'), rows)


def ends(method: str) -> dict[Topic, list[str]]:
    """Find which node calls `advertise` or `subscribe` with which topic."""
    found: dict[Topic, list[str]] = {}
    for file in (*NODES, *HELPERS):
        path = ROOT / 'handover_dmp' / 'nodes' / f'{file}.py'
        for call in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if (
                isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and call.func.attr == method
                and isinstance(call.args[0], ast.Name)
            ):
                node = HELPERS.get(file, file)
                found.setdefault(getattr(topics, call.args[0].id), []).append(
                    node if ' ' in node else f'`{node}`'
                )
    return found


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a Markdown table."""
    lines = [header, ['---'] * len(header), *rows]
    return ''.join(f'| {" | ".join(cell.replace("|", "/") for cell in row)} |\n' for row in lines)


def shown(value: Any) -> str:
    """Format a default."""
    if value is None:
        return 'not set'
    if isinstance(value, bool):
        return f'`{str(value).lower()}`'
    if isinstance(value, float):
        return f'`{number(value)}`'
    if value in ('', ['']):
        return 'empty'
    return f'`{value}`'


def kind(value: Any) -> str:
    """Name the type of a parameter without range."""
    kinds = {bool: '`true`, `false`', str: 'text', list: 'list'}
    return kinds.get(type(value), 'list of numbers')


def number(value: float) -> str:
    """Format a number as short as possible."""
    return f'{value:,.10g}'.replace(',', ' ') if abs(value) < 1e6 else f'{value:.3g}'


if __name__ == '__main__':
    sys.exit(main())
