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

"""Both ways to install it, pip and colcon, give the layout that `ros2 run` looks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from xml.etree import ElementTree

from handover_dmp import __version__
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
NODES = (
    'robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder', 'velocity_to_position',
    'calibration_motion',
)  # fmt: skip
# Without the one that refuses to command an arm beside `priority_ik`.
TOGETHER = tuple(name for name in NODES if name != 'calibration_motion')
# What an install is made from; the rest of a checkout (.venv, runs, caches) may be large.
SOURCES = (
    'setup.py', 'setup.cfg', 'pyproject.toml', 'package.xml', 'LICENSE', 'README.md', 'resource',
    'scripts', 'handover_dmp', 'config', 'urdf', 'launch',
)  # fmt: skip
PATIENCE_S = 120.0


@dataclass(frozen=True)
class Installed:
    """
    The package in a prefix of its own.

    Attributes:
        prefix: where it was installed to.
        environment: environment variables under which it is used.

    """

    prefix: Path
    environment: dict[str, str]

    @property
    def executables(self) -> Path:
        """Return the folder in which `ros2 run` looks."""
        return self.prefix / 'lib' / 'handover_dmp'

    @property
    def share(self) -> Path:
        """Return the package's share folder."""
        return self.prefix / 'share' / 'handover_dmp'

    def run(self, *command: str | Path) -> subprocess.CompletedProcess[str]:
        """Run a command there, far from the checkout; it must succeed."""
        result = subprocess.run(
            [str(word) for word in command],
            env=self.environment,
            cwd='/',
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
        assert result.returncode == 0, result.stdout + result.stderr
        return result


def environment() -> dict[str, str]:
    """Return an environment in which this Python is `python3`, and nothing else is installed."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ('AMENT_PREFIX_PATH', 'COLCON_PREFIX_PATH', 'PYTHONPATH', 'VIRTUAL_ENV')
    }
    kept['PATH'] = f'{Path(sys.executable).parent}{os.pathsep}{kept["PATH"]}'
    kept['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    return kept


def checked(command: Sequence[str | Path], folder: Path, variables: dict[str, str]) -> str:
    """Run a command that has to succeed and return what it printed."""
    result = subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert result.returncode == 0, result.stdout
    return result.stdout


def copy_sources(target: Path, *more: str) -> Path:
    """Copy what an install is made from, so that the checkout stays as it is."""
    ignored = shutil.ignore_patterns('__pycache__', '*.egg-info')
    for name in (*SOURCES, *more):
        source = ROOT / name
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target / name, symlinks=True, ignore=ignored)
        else:
            shutil.copy2(source, target / name)
    return target


def see_this_environment(prefix: Path) -> None:
    """Let what the package depends on be that of this environment: the tests need no network."""
    (site_packages,) = prefix.glob('lib/python3*/site-packages')
    outer = sysconfig.get_path('purelib')
    (site_packages / 'outer.pth').write_text(f'import site; site.addsitedir({outer!r})\n')


@pytest.fixture(scope='module')
def pip_layout(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Build the wheel and install it to a virtual environment of its own."""
    folder = tmp_path_factory.mktemp('pip')
    source, prefix = copy_sources(folder / 'source'), folder / 'venv'
    variables = environment()
    pip = (sys.executable, '-m', 'pip', '--disable-pip-version-check')
    offline = ('--no-deps', '--no-index')
    checked(
        (*pip, 'wheel', *offline, '--no-build-isolation', '-w', folder, source), folder, variables
    )
    (wheel,) = folder.glob('*.whl')
    checked((sys.executable, '-m', 'venv', '--without-pip', prefix), folder, variables)
    checked((*pip, '--python', prefix, 'install', *offline, wheel), folder, variables)
    see_this_environment(prefix)
    # Another Python is first on the PATH: the nodes have to take that of their own prefix.
    return Installed(prefix, variables | {'AMENT_PREFIX_PATH': str(prefix)})


def test_an_editable_install_has_what_ros2_run_looks_for(tmp_path: Path) -> None:
    source, prefix = copy_sources(tmp_path / 'source'), tmp_path / 'venv'
    checked((sys.executable, '-m', 'venv', '--without-pip', prefix), tmp_path, environment())
    see_this_environment(prefix)
    words = f'--disable-pip-version-check --python {prefix} install --no-deps --no-index'
    words += f' --no-build-isolation --editable {source}'
    checked((sys.executable, '-m', 'pip', *words.split()), tmp_path, environment())
    for name in NODES:
        assert os.access(prefix / 'lib' / 'handover_dmp' / name, os.X_OK), name
    share_folder = prefix / 'share'
    assert (share_folder / 'ament_index/resource_index/packages/handover_dmp').is_file()
    for file in ('package.xml', 'launch/handover.launch.py', 'config/handover.yaml'):
        copied = share_folder / 'handover_dmp' / file
        assert copied.read_bytes() == (source / file).read_bytes()


@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a colcon workspace that holds the package and a few of its tests."""
    colcon = Path(sys.executable).with_name('colcon')
    if not colcon.is_file():
        pytest.skip('colcon is not installed')
    folder = tmp_path_factory.mktemp('colcon')
    copy_sources(
        folder / 'src' / 'handover_dmp', 'test/conftest.py', 'test/common/test_resources.py'
    )
    checked((colcon, 'build', '--event-handlers', 'console_direct+'), folder, colcon_home(folder))
    return folder


def colcon_home(folder: Path) -> dict[str, str]:
    """Return an environment in which colcon leaves its files in the workspace."""
    return environment() | {'COLCON_HOME': str(folder / 'home')}


@pytest.fixture(scope='module')
def colcon_layout(workspace: Path) -> Installed:
    """Source the workspace, as its user does."""
    lines = checked(
        ('sh', '-c', '. install/local_setup.sh && env'), workspace, colcon_home(workspace)
    )
    pairs = (line.partition('=') for line in lines.splitlines())
    variables = {name: value for name, _, value in pairs if re.fullmatch(r'\w+', name)}
    return Installed(workspace / 'install' / 'handover_dmp', variables)


@pytest.fixture(params=['pip', 'colcon'])
def installed(request: pytest.FixtureRequest) -> Installed:
    """Give one layout after the other."""
    layout: Installed = request.getfixturevalue(f'{request.param}_layout')
    return layout


def test_the_ament_index_knows_the_package(installed: Installed) -> None:
    marker = installed.prefix / 'share/ament_index/resource_index/packages/handover_dmp'
    assert marker.is_file()
    assert str(installed.prefix) in installed.environment['AMENT_PREFIX_PATH'].split(os.pathsep)
    pytest.importorskip('ament_index_python')
    program = (
        'from ament_index_python import get_package_prefix, get_package_share_directory as share;'
        'print(get_package_prefix("handover_dmp"), share("handover_dmp"))'
    )
    found = installed.run('python3', '-c', program).stdout.split()
    assert found == [str(installed.prefix), str(installed.share)]


def test_the_nodes_are_what_ros2_run_offers(installed: Installed) -> None:
    offered = {path.name for path in installed.executables.iterdir() if os.access(path, os.X_OK)}
    assert offered - {'handover_dmp'} == set(NODES)


def test_no_command_of_a_generic_name_is_on_the_path(pip_layout: Installed) -> None:
    commands = {path.name for path in (pip_layout.prefix / 'bin').iterdir()}
    assert 'handover_dmp' in commands
    assert not commands & set(NODES)
    assert (pip_layout.executables / 'handover_dmp').exists() is False


def test_share_holds_every_file_of_the_source_tree(installed: Installed) -> None:
    for folder in ('config', 'launch', 'urdf'):
        files = [path for path in (ROOT / folder).rglob('*') if path.is_file()]
        assert files, f'{folder} is empty'
        for file in files:
            if '__pycache__' not in file.parts:
                assert (installed.share / file.relative_to(ROOT)).read_bytes() == file.read_bytes()
    assert (installed.share / 'package.xml').is_file()


def test_every_module_is_installed(installed: Installed) -> None:
    (package,) = installed.prefix.glob('lib/python3*/site-packages/handover_dmp')
    source = ROOT / 'handover_dmp'
    wanted = {path.relative_to(source) for path in source.rglob('*.py')}
    assert {path.relative_to(package) for path in package.rglob('*.py')} == wanted
    assert (package / 'py.typed').is_file()


def test_the_command_uses_the_files_that_came_with_it(
    installed: Installed, request: pytest.FixtureRequest
) -> None:
    python = installed.prefix / 'bin' / 'python3'
    program = (
        'import handover_dmp; from handover_dmp.common.resources import share_path;'
        'print(handover_dmp.__file__, share_path("config/handover.yaml"))'
    )
    found = installed.run(python if python.exists() else 'python3', '-c', program).stdout.split()
    for path in found:
        assert Path(path).is_relative_to(installed.prefix)
    commands = installed.executables, installed.prefix / 'bin'
    (command,) = (path for folder in commands if (path := folder / 'handover_dmp').is_file())
    assert installed.run(command, '--version').stdout == f'{__version__}\n'


@pytest.mark.ros
@pytest.mark.parametrize(('layout', 'names'), [('pip', TOGETHER), ('colcon', TOGETHER[-2:])])
def test_the_nodes_start_and_end(
    layout: str, names: tuple[str, ...], request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    pytest.importorskip('rclpy')
    installed: Installed = request.getfixturevalue(f'{layout}_layout')
    variables = installed.environment
    processes = [
        subprocess.Popen(
            [installed.executables / name, '--ros-args', '-p', 'use_sim_time:=false'],
            env=variables,
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for name in names
    ]
    try:
        wait_for_nodes(set(names), processes)
        for process in processes:
            process.send_signal(signal.SIGINT)
        for name, process in zip(names, processes, strict=True):
            text, _ = process.communicate(timeout=PATIENCE_S)
            assert process.returncode == 0, f'{name}: {text}'
            assert 'Traceback' not in text, f'{name}: {text}'
    finally:
        for process in processes:
            process.kill()
            process.wait()


def wait_for_nodes(names: set[str], processes: Sequence[subprocess.Popen[str]]) -> None:
    """Wait until nodes of these names are in the graph."""
    from handover_dmp.nodes.shutdown import shut_down
    import rclpy

    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('packaging', context=context)
    try:
        end = time.monotonic() + PATIENCE_S
        while not names <= set(node.get_node_names()):
            for process in processes:
                assert process.poll() is None, process.communicate()[0]
            assert time.monotonic() < end, f'only {node.get_node_names()} came up'
            time.sleep(0.05)
    finally:
        shut_down(node)


def test_a_launcher_hands_over_arguments_and_process(tmp_path: Path) -> None:
    """It becomes Python, so that signals reach the node and none is left behind."""
    prefix = tmp_path / 'prefix'
    launcher = prefix / 'lib' / 'handover_dmp' / 'dmp'
    launcher.parent.mkdir(parents=True)
    shutil.copy2(ROOT / 'scripts' / 'dmp', launcher)
    python = prefix / 'bin' / 'python3'
    python.parent.mkdir()
    python.write_text('#!/bin/sh\necho $$ "$0"\nfor word; do echo "<$word>"; done\n')
    python.chmod(0o755)
    with subprocess.Popen(
        [launcher, 'a b', '', '*'], stdout=subprocess.PIPE, text=True
    ) as started:
        lines = started.communicate(timeout=PATIENCE_S)[0].splitlines()
    number, name = lines[0].split()
    assert int(number) == started.pid
    assert Path(name).resolve() == python
    assert lines[1:] == ['<-m>', '<handover_dmp.nodes.dmp>', '<a b>', '<>', '<*>']


def test_a_launcher_without_a_python_of_its_own_takes_that_of_the_path(tmp_path: Path) -> None:
    launcher = tmp_path / 'prefix' / 'lib' / 'handover_dmp' / 'recorder'
    launcher.parent.mkdir(parents=True)
    shutil.copy2(ROOT / 'scripts' / 'recorder', launcher)
    python = tmp_path / 'bin' / 'python3'
    python.parent.mkdir()
    python.write_text('#!/bin/sh\necho "$2"\n')
    python.chmod(0o755)
    path = f'{python.parent}{os.pathsep}{os.environ["PATH"]}'
    text = checked([launcher], tmp_path, {'PATH': path})
    assert text == 'handover_dmp.nodes.recorder\n'


def test_colcon_runs_the_tests(workspace: Path) -> None:
    colcon = Path(sys.executable).with_name('colcon')
    variables = colcon_home(workspace)
    checked(
        (colcon, 'test', '--event-handlers', 'console_direct+', '--return-code-on-test-failure'),
        workspace,
        variables,
    )
    summary = checked((colcon, 'test-result', '--all'), workspace, variables)
    tests, errors, failures = map(
        int, re.search(r'Summary: (\d+) tests?, (\d+) errors?, (\d+) failures?', summary).groups()
    )
    assert tests > 0
    assert (errors, failures) == (0, 0)


def package_xml() -> ElementTree.Element:
    """Return the root element of `package.xml`."""
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def test_one_version_everywhere() -> None:
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    changelog = (ROOT / 'CHANGELOG.md').read_text(encoding='utf-8')
    assert package_xml().findtext('version') == __version__
    assert citation['version'] == __version__
    assert re.search(r'^## (\S+)', changelog, re.MULTILINE).group(1) == __version__


def test_package_xml_is_what_colcon_and_ament_want() -> None:
    root = package_xml()
    assert root.get('format') == '3'
    assert root.findtext('name') == 'handover_dmp'
    assert root.findtext('license') == 'Apache-2.0'
    assert root.findtext('export/build_type') == 'ament_python'
    # An address of no valid form makes colcon drop the hooks of ament without a word.
    addresses = [maintainer.get('email') for maintainer in root.findall('maintainer')]
    assert addresses
    for address in addresses:
        assert re.fullmatch(r'[\w.+-]+@[\w-]+(\.[\w-]+)+', address)
    names = [element.text for element in root if element.tag.endswith('_depend')]
    assert len(names) == len(set(names))


WITH_PINOCCHIO = {'pin', 'coal', 'eigenpy'}


def declared(name: str) -> dict[str, str]:
    """Return the requirements of a list in `setup.py`: name to bound."""
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    part = re.search(rf"^(?:{name} =| +'{name}':) \[$(.*?)^ *\]", text, re.MULTILINE | re.DOTALL)
    return dict(re.findall(r"^ +'([\w.-]+)(?:\[\w+\])?>=([\d.]+)", part.group(1), re.MULTILINE))


def by_pip() -> dict[str, str]:
    """Return what goes into the environment beside a colcon workspace: name to bound."""
    lines = (ROOT / 'requirements-colcon.txt').read_text(encoding='utf-8').splitlines()
    return dict(line.split('>=') for line in lines if not line.startswith('#'))


def test_rosdep_and_pip_bring_exactly_what_is_required() -> None:
    """Beside a ROS 2 that apt installed; there is no key that ends in a plain pip install."""
    keys = [str(element.text) for element in package_xml().findall('exec_depend')]
    assert not [key for key in keys if key.endswith('-pip')]
    by_rosdep = {key.removeprefix('python3-') for key in keys if key.startswith('python3-')}
    known = {'pil': 'pillow', 'yaml': 'PyYAML'}
    by_rosdep = {known.get(key, key) for key in by_rosdep} | {'xacro'}
    assert {'pinocchio', 'xacro'} <= set(keys)
    required = declared('REQUIREMENTS')
    # of the two builds of PyBullet, the one for the Python of Ubuntu 24.04
    del required['pybullet']
    assert by_rosdep | set(by_pip()) | WITH_PINOCCHIO == set(required)
    assert not by_rosdep & set(by_pip())
    assert by_pip() == {name: required[name] for name in by_pip()}


UBUNTU_24_04 = {
    'joblib': '1.3.2', 'matplotlib': '3.6.3', 'numpy': '1.26.4', 'pillow': '10.2.0',
    'PyYAML': '6.0.1', 'rich': '13.7.1', 'scipy': '1.11.4',
}  # fmt: skip


def test_what_ubuntu_has_is_new_enough() -> None:
    required = declared('REQUIREMENTS')
    for name, version in UBUNTU_24_04.items():
        bound, there = ([*map(int, text.split('.'))] for text in (required[name], version))
        assert bound <= there, name


def test_the_readme_tells_of_every_step_beside_a_ros_that_apt_installed() -> None:
    readme = (ROOT / 'README.md').read_text(encoding='utf-8')
    (block,) = (each for each in readme.split('```') if '/opt/ros/jazzy' in each)
    steps = [
        'source /opt/ros/jazzy/setup.bash', 'rosdep install --from-paths',
        'venv --system-site-packages', 'COLCON_IGNORE',
        'pip install -r src/handover_dmp/requirements-colcon.txt', '"$(command -v colcon)" build',
        'source install/setup.bash', 'ros2 launch handover_dmp handover.launch.py',
    ]  # fmt: skip
    places = [block.index(step) for step in steps]
    assert places == sorted(places)
    checked(('bash', '-n', '-c', block.removeprefix('sh')), ROOT, environment())


def test_the_oldest_libraries_are_those_of_setup_py() -> None:
    told = [
        checked((sys.executable, 'scripts/lower_bounds.py', *words), ROOT, environment())
        for words in ((), ('pinocchio',))
    ]
    found, of_pinocchio = (dict(re.findall(r'^([\w.-]+).*?==([\d.]+)', t, re.M)) for t in told)
    wanted = declared('REQUIREMENTS') | declared('ros') | declared('test')
    assert not found.keys() & WITH_PINOCCHIO
    assert of_pinocchio.pop('libpinocchio') == wanted['pin']
    assert of_pinocchio.pop('libcoal') == wanted['coal']
    assert found | of_pinocchio == wanted


@pytest.mark.parametrize(
    ('changed', 'again'), [('package.xml', True), ('scripts/__pycache__', False)]
)
def test_make_installs_again_if_a_file_has_changed(
    tmp_path: Path, changed: str, again: bool
) -> None:
    (ROOT / 'scripts' / '__pycache__').mkdir(exist_ok=True)
    (tmp_path / 'bin').mkdir()
    for name in ('bin/python', '.demo', '.test'):
        (tmp_path / name).touch()
    command = ['make', '--dry-run', f'--what-if={changed}', f'VENV={tmp_path}', 'test']
    told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert ('pip install' in told) is again


def test_the_workflow_has_the_form_that_github_wants() -> None:
    pytest.importorskip('check_jsonschema')
    files = (ROOT / '.github' / 'workflows').glob('*.yml')
    schema = ('--builtin-schema', 'vendor.github-workflows')
    checked((sys.executable, '-m', 'check_jsonschema', *schema, *files), ROOT, environment())


def test_the_workflow_runs_the_two_commands_on_every_python() -> None:
    text = (ROOT / '.github' / 'workflows' / 'ci.yml').read_text(encoding='utf-8')
    jobs = yaml.safe_load(text)['jobs']
    assert jobs['pip']['strategy']['matrix']['python'] == ['3.10', '3.11', '3.12', '3.13']
    assert jobs['pip']['runs-on'] == 'ubuntu-24.04'
    commands = [step['run'] for step in jobs['pip']['steps'] if 'run' in step]
    assert commands == ['make demo', 'make test']
    assert jobs['colcon']['container'] == 'ros:jazzy'


def test_catkin_pkg_finds_no_fault(recwarn: pytest.WarningsRecorder) -> None:
    package = pytest.importorskip('catkin_pkg.package')
    warnings: list[str] = []
    package.parse_package(str(ROOT / 'package.xml'), warnings=warnings).validate(warnings=warnings)
    assert warnings == []


def test_citation_names_the_paper() -> None:
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text(encoding='utf-8'))
    paper = citation['preferred-citation']
    assert citation['license'] == 'Apache-2.0'
    assert paper['doi'] == '10.1109/IROS.2013.6696498'
    assert [author['family-names'] for author in paper['authors']] == [
        'Prada', 'Remazeilles', 'Koene', 'Endo',
    ]  # fmt: skip
