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
Every command in README and docs works.

Commands are the lines of the shell blocks. They are run in order, in one folder with the files
that a reader is assumed to have; a command that nothing here knows is a failure. Without `ros2`
its work is done in other ways: `run` starts the node's process, `bag play` a player of our own
that sends the same bytes at the same times, `service`, `param` and `topic` ask a graph that runs.
`make` only says what it would do, since it is what runs this.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys
from time import monotonic, sleep
from typing import Any

from handover_dmp.bench.odd_arms import lbr
from handover_dmp.cli.main import main
from handover_dmp.common.settings import defaults
from handover_dmp.dmp import DmpParameters
from handover_dmp.dmp.parameter_file import TunedParameters, write_parameters
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.mocap import synthesize, write_trial
from handover_dmp.nodes.graph import Graph, isolate, NODES
from handover_dmp.nodes.parameters import is_of_tracker
from handover_dmp.nodes.qos import message_class, qos_profile
from handover_dmp.nodes.run_graph import graph_parameters
from handover_dmp.nodes.shutdown import shut_down
from handover_dmp.recording import read_bag
from handover_dmp.runs.folder import keep_inputs
from handover_dmp.topics import HAND_POSE, STATE
import numpy as np
import pytest
from rcl_interfaces.srv import DescribeParameters, SetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
import yaml

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
ROS2 = shutil.which('ros2')
PLAYER = ROOT / 'test' / 'nodes' / 'play_bag.py'
# What a launch needs with these; it ends at once where that is missing.
VIEWERS = {'rviz:=true': ('tf2_msgs', 'rviz2'), 'foxglove:=true': ('tf2_msgs', 'foxglove_bridge')}
WAIT_S = 90.0
FIRST_POSES_S = 0.3
# These take a quarter of a minute and more each.
MINUTES = (
    ' bench', ' tune ', ' render runs', ' evaluate ', '--robot panda', ' demo --tr',
    ' tracker.yaml', ' simulate --robot', ' demo --session',
)  # fmt: skip


def commands(path: Path) -> list[str]:
    """Return the lines of the shell blocks of a document, without comments."""
    text = path.read_text(encoding='utf-8')
    lines: list[str] = []
    for block in re.findall(r'^```(?:sh|bash|shell|console)\n(.*?)^```', text, re.M | re.S):
        # what needs a ROS 2 of the system, test_packaging.py reads
        if '/opt/ros/' not in block:
            lines += block.replace('\\\n', ' ').splitlines()
    # CONTRIBUTING and others indent theirs.
    indented = re.findall(
        r'^    ((?:make|\.venv/bin/\S+|handover_dmp|ros2|colcon)\s.*)$', text, re.M
    )
    words = [re.sub(r'\s#\s.*$', '', line).strip() for line in lines + indented]
    return [word for word in words if word and not word.startswith('#')]


# What several documents say is done once.
FIRST: dict[str, str] = {}
for path in DOCUMENTS:
    for line in commands(path):
        FIRST.setdefault(line, path.relative_to(ROOT).as_posix())
ALL = [(document, line) for line, document in FIRST.items()]


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with the files that the documents speak of as the reader's own."""
    folder = tmp_path_factory.mktemp('reader')
    trial = next(trial for trial in synthesize(trials=1) if trial.direction == 'take')
    write_trial(trial, folder / 'my_trial.csv')
    # those of the checkout, or of where it is installed
    shutil.copytree(ROOT / 'config', folder / 'config')
    urdf = (ROOT / 'urdf' / 'lwr4.urdf').read_text(encoding='utf-8')
    (folder / 'my_arm.urdf').write_text(urdf, encoding='utf-8')
    (folder / 'my_arm.urdf.xacro').write_text(
        urdf.replace('<robot ', '<robot xmlns:xacro="http://wiki.ros.org/xacro" '),
        encoding='utf-8',
    )
    (folder / 'iiwa14.urdf').write_text(lbr('iiwa14'), encoding='utf-8')
    values = {'dmp': {'ros__parameters': {'exchange_distance_m': 0.03}}}
    (folder / 'my_parameters.yaml').write_text(yaml.safe_dump(values), encoding='utf-8')
    # What `tune` writes.
    write_parameters(TunedParameters(DmpParameters(), 1.0), folder / 'tuned.yaml', 'tuned')
    (folder / 'recording.tsv').write_text(
        qualisys(trial.partner, trial.demonstrator), encoding='utf-8'
    )
    rest = (
        np.repeat(trial.partner[:1], 200, axis=0),
        np.repeat(trial.demonstrator[:1], 200, axis=0),
    )
    there_and_back = [
        np.vstack([a, p, p[::-1], a])
        for a, p in zip(rest, (trial.partner, trial.demonstrator), strict=True)
    ]
    (folder / 'session.tsv').write_text(qualisys(*there_and_back), encoding='utf-8')
    return folder


def qualisys(partner: np.ndarray, demonstrator: np.ndarray) -> str:
    """Write two markers as Qualisys Track Manager does."""
    lines = [
        f'NO_OF_FRAMES\t{len(partner)}', 'NO_OF_MARKERS\t2', 'FREQUENCY\t200', 'DATA_INCLUDED\t3D',
        'MARKER_NAMES\tM_wrist\tA_wrist',
    ]  # fmt: skip
    rows = 1000.0 * np.hstack([partner, demonstrator])
    return '\n'.join([*lines, *('\t'.join(f'{x:.3f}' for x in row) for row in rows)]) + '\n'


@pytest.fixture(scope='module')
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    """
    Give the five nodes at rest, for what is asked of a running graph.

    Their time stands still; else they would take most of a small machine meanwhile.
    """
    folder = tmp_path_factory.mktemp('graph')
    scenario = make_scenario()
    keep_inputs(folder, scenario)
    parameters = graph_parameters(folder, scenario, {}, lockstep=True)
    parameters['hand_tracker']['replay_at_s'] = -1.0  # when it is told
    with Graph(folder, parameters) as running:
        running.pause(False)
        running.linger(FIRST_POSES_S)
        running.pause(True)
        yield running


def marked(document: str, line: str) -> Any:
    """Put what takes minutes, and what needs DDS, behind the markers for that."""
    marks = [pytest.mark.ros] if line.startswith('ros2') else []
    marks += [pytest.mark.slow] if any(word in line for word in MINUTES) else []
    return pytest.param(document, line, marks=marks, id=f'{document}: {line[:50]}')


@pytest.mark.timeout(1800)  # a verb on a machine that does much else
@pytest.mark.parametrize(('document', 'line'), [marked(*each) for each in ALL])
def test_every_command(
    document: str, line: str, folder: Path, request: pytest.FixtureRequest
) -> None:
    words = shlex.split(line.replace('$PWD', str(folder)))
    name = words[0].removeprefix('.venv/bin/')
    assert name in RUN, f'{document}: nothing here knows how to run {line!r}'
    RUN[name](words[1:], folder, request)


def run(words: list[str], folder: Path) -> None:
    """Run a command in the reader's folder; it must succeed."""
    result = subprocess.run(
        words, cwd=folder, env=environment_alone(), capture_output=True, text=True
    )
    assert result.returncode == 0, result.stdout + result.stderr


def run_own(words: list[str], folder: Path, request: pytest.FixtureRequest) -> None:
    """Run a verb; `view` until its page is there, and what speaks ROS in a domain of its own."""
    command = [sys.executable, '-m', 'handover_dmp', *words]
    if words[0] == 'view':
        with ended_by_interrupt([*command, '--no-browser'], folder) as process:
            assert process.stdout is not None
            assert 'http://127.0.0.1' in process.stdout.readline()
    elif words[:2] == ['bench', 'compare']:
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        # 1 says that something got slower, as it may on a machine that does much else
        assert result.returncode in (0, 1), result.stdout + result.stderr
        assert 'is worse by more than' in result.stdout or result.returncode == 1
    elif words[0] in ('bench', 'calibrate', 'demo', '--help'):
        run(command, folder)
    else:
        request.getfixturevalue('monkeypatch').chdir(folder)
        assert main(words) == 0, request.getfixturevalue('capsys').readouterr().err


def run_python(words: list[str], folder: Path, _request: pytest.FixtureRequest) -> None:
    """Run a node of the examples until it is there."""
    script = ROOT / words[0]
    with ended_by_interrupt([sys.executable, str(script), *words[1:]], folder):
        wait_for_node(script.stem)


def ask_make(words: list[str], _folder: Path, _request: pytest.FixtureRequest) -> None:
    """Let make say what it would do."""
    run(['make', '--dry-run', *words], ROOT)


def run_colcon(words: list[str], folder: Path, _request: pytest.FixtureRequest) -> None:
    """Build a copy of the package."""
    pytest.importorskip('colcon_core')
    package = folder / 'workspace' / 'src' / 'handover_dmp'
    ignored = shutil.ignore_patterns('.*', 'runs', 'build', 'install', 'log', '*.egg-info')
    shutil.copytree(ROOT, package, ignore=ignored)
    run([str(Path(sys.executable).with_name('colcon')), *words], folder / 'workspace')


def run_ros2(words: list[str], folder: Path, request: pytest.FixtureRequest) -> None:
    """Do what the `ros2` command would."""
    match words:
        case ['run', 'handover_dmp', node, *arguments]:
            assert node in (*NODES, 'velocity_to_position')
            # one that is not declared would be passed over
            told = set(re.findall(r'-p (\S+?):=', ' '.join(arguments)))
            assert {name for name in told if not is_of_tracker(name)} <= {*defaults(node)}
            command = [sys.executable, '-m', f'handover_dmp.nodes.{node}', *arguments]
            with ended_by_interrupt(command, folder):
                wait_for_node(node)
        case ['service', 'call', service, 'std_srvs/srv/Trigger']:
            request.getfixturevalue('graph').call(service)
        case ['param', 'describe', node, name]:
            asked = DescribeParameters.Request(names=[name])
            answer = ask(request, DescribeParameters, f'{node}/describe_parameters', asked)
            assert answer.descriptors[0].description
        case ['param', 'set', node, name, value]:
            parameter = Parameter(name, value=float(value)).to_parameter_msg()
            asked = SetParameters.Request(parameters=[parameter])
            answer = ask(request, SetParameters, f'{node}/set_parameters', asked)
            assert answer.results[0].successful, answer.results[0].reason
        case ['topic', 'echo', topic]:
            assert topic == STATE.name
            running: Graph = request.getfixturevalue('graph')
            end_s = monotonic() + WAIT_S
            while not running.state:
                running.spin()
                assert monotonic() < end_s
        case ['bag', 'play', bag, *_]:
            play_bag(words, folder, folder / bag, request.getfixturevalue('ros2_bag'))
        case ['launch' | 'security', *_]:
            if ROS2 is None:
                pytest.skip('ros2 is not installed')
            for package in (each for word in words for each in VIEWERS.get(word, ())):
                asked = [ROS2, 'pkg', 'prefix', package]
                if subprocess.run(asked, capture_output=True).returncode:
                    pytest.skip(f'{package} is not installed')
            with ended_by_interrupt([ROS2, *words], folder) as process:
                wait_for_node('dmp') if words[0] == 'launch' else process.wait(WAIT_S)
        case _:
            pytest.fail(f'ros2 {" ".join(words)}: unknown here')


def play_bag(words: list[str], folder: Path, bag: Path, ros2: str | None) -> None:
    """Play a bag to its end; who listens must hear of the hand what is in the bag."""
    recorded = {place_of(message) for _, message, _ in read_bag(bag, [HAND_POSE.name])}
    own = [sys.executable, str(PLAYER), *words[2:], '--heard', HAND_POSE.name, '1']
    command = [ros2, *words] if ros2 else own
    context = rclpy.Context()
    context.init(args=[], domain_id=domain_alone())
    node = rclpy.create_node('listen', context=context, use_global_arguments=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    heard: list[tuple[float, float, float]] = []
    node.create_subscription(
        message_class(HAND_POSE.type_name),
        HAND_POSE.name,
        lambda message: heard.append(place_of(message)),
        qos_profile(HAND_POSE.quality),
    )
    try:
        with ended_by_interrupt(command, folder) as process:
            end_s = monotonic() + WAIT_S
            while process.poll() is None:
                executor.spin_once(timeout_sec=0.05)
                assert monotonic() < end_s, f'{bag} does not end'
    finally:
        executor.shutdown()
        shut_down(node)
    assert len(set(heard)) > 10
    assert set(heard) <= recorded


def place_of(message: Any) -> tuple[float, float, float]:
    """Return the position of a pose, whoever has decoded it."""
    place = message.pose.position
    return place.x, place.y, place.z


def ask_shell(words: list[str], folder: Path, _request: pytest.FixtureRequest) -> None:
    """Let a shell take the line; what it sets is for ROS and for Fast DDS."""
    for word in words:
        assert word.startswith(('ROS_', 'FASTRTPS_')), word
    run(['sh', '-e', '-c', shlex.join(['export', *words])], folder)


def let_pass(_words: list[str], _folder: Path, _request: pytest.FixtureRequest) -> None:
    """Change environment: nothing to run."""


RUN: dict[str, Callable[[list[str], Path, pytest.FixtureRequest], None]] = {
    'handover_dmp': run_own,
    'python': run_python,
    'make': ask_make,
    'ros2': run_ros2,
    'export': ask_shell,
    'colcon': run_colcon,
    '.': let_pass,
}


@contextmanager
def ended_by_interrupt(command: list[str], folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Run a command until the block ends, and then by SIGINT, which it must take well."""
    with subprocess.Popen(
        command,
        cwd=folder,
        env=environment_alone(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                said = process.communicate(timeout=WAIT_S)[1]
            except subprocess.TimeoutExpired:
                process.kill()
                raise
        assert process.returncode == 0, said


def environment_alone() -> dict[str, str]:
    """Give the environment of a command that shall not hear the running graph."""
    return {**os.environ, 'ROS_DOMAIN_ID': str(domain_alone())}


def domain_alone() -> int:
    """Give a domain next to that of the running graph, which has nodes of the same names."""
    isolate()
    return int(os.environ['ROS_DOMAIN_ID']) % 100 + 1


def wait_for_node(name: str) -> None:
    """Look for a node until it is in the graph."""
    context = rclpy.Context()
    context.init(args=[], domain_id=domain_alone())
    node = rclpy.create_node('look', context=context, use_global_arguments=False)
    try:
        end_s = monotonic() + WAIT_S
        while name not in node.get_node_names():
            sleep(0.05)
            assert monotonic() < end_s, f'{name} is not there'
    finally:
        shut_down(node)


def ask(request: pytest.FixtureRequest, kind: Any, service: str, asked: Any) -> Any:
    """Call a service of the running graph."""
    running: Graph = request.getfixturevalue('graph')
    client = running.node.create_client(kind, service)
    end_s = monotonic() + WAIT_S
    future = None
    while future is None or not future.done():
        if future is None and client.service_is_ready():
            future = client.call_async(asked)
        running.spin()
        assert monotonic() < end_s, service
    return future.result()


def test_the_documents_have_commands() -> None:
    assert len(ALL) > 25
    assert {'README.md', 'docs/parameters.md', 'docs/topics.md'} <= {name for name, _ in ALL}


def test_readme_begins_with_the_two_commands() -> None:
    assert commands(ROOT / 'README.md')[:2] == ['make demo', 'make test']
