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

"""What several rooms' tests share, and how they are run side by side."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
import gc
import os
from pathlib import Path
import shutil
import subprocess
from typing import Any

from handover_dmp.common.threads import use_one_thread
from hypothesis import settings
import pytest

use_one_thread()

# `make test` tries the same examples each time; `make longtest` looks for new ones.
NEW_EXAMPLES = 'new'
settings.register_profile('same', derandomize=True, deadline=None)
settings.register_profile(NEW_EXAMPLES, deadline=None, print_blob=True)
settings.load_profile('same')

DATA = Path(__file__).resolve().parents[2] / 'shared' / 'data'
KTH = DATA / 'kth_handovers'
DOMAINS = 100
MEMORY_OF_A_PROCESS = 2 * 1024**3
# Each of these has a graph keep pace with the wall clock. Two at once would be too much for two
# processors; graphs in lockstep wait for whatever else is run.
ON_THE_WALL_CLOCK = ('test_graph', 'test_interfaces', 'test_played_bags')
# These take longest, and begin first: in the end no process is to wait for another.
LONGEST = (
    *ON_THE_WALL_CLOCK, 'test_faults_graph', 'test_commands', 'test_demo', 'test_packaging',
    'test_calibration_motion_node', 'test_session_processes', 'test_approach',
)  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Give every process of tests a ROS domain; the next one is left to it, too."""
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    first = int(os.environ.get('ROS_DOMAIN_ID') or os.getpid())
    os.environ['ROS_DOMAIN_ID'] = str((first - 1 + 2 * worker) % DOMAINS + 1)
    if config.getoption('hypothesis_profile', None) != NEW_EXAMPLES:
        _draw_the_same_whatever_is_imported()


def _draw_the_same_whatever_is_imported() -> None:
    """
    Keep hypothesis from drawing numbers that it finds in the modules of this project.

    Which of them are imported depends on the tests that ran before. Older versions never look.
    """
    with suppress(ImportError):
        from hypothesis.internal.conjecture import providers

        if hasattr(providers, '_get_local_constants') and hasattr(providers, 'Constants'):
            nothing = providers.Constants()
            providers._get_local_constants = lambda: nothing


@pytest.hookimpl(tryfirst=True)  # before the slow ones are left out
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first; mark as slow what is not in the sample of many alike cases."""
    items.sort(key=lambda item: item.path.stem not in LONGEST)
    cases: Counter[str] = Counter()
    for item in items:
        if sample := item.get_closest_marker('sample'):
            function = item.nodeid.partition('[')[0]
            if cases[function] % sample.args[0]:
                item.add_marker(pytest.mark.slow)
            cases[function] += 1


def pytest_collection_finish() -> None:
    """Spare the garbage collection what stays: thousands of tests and all modules."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Run two processes more than there are processors, as memory permits: tests often wait."""
    wanted = os.environ.get('PYTEST_XDIST_AUTO_NUM_WORKERS')
    if wanted:
        return int(wanted)
    memory = os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES')
    return max(1, min((os.cpu_count() or 1) + 2, memory // MEMORY_OF_A_PROCESS))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """
    Let tests of a file share what they set up, and those on the wall clock run one at a time.

    By the files: the marks of pytest-xdist 3.8 (`--dist loadgroup`) are lost in pytest 9.2.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition('::')[0]
            return 'wall clock' if Path(file).stem in ON_THE_WALL_CLOCK else file

    # else those with the most tests would come first
    config.option.loadscopereorder = False
    return ByFile(config, log)


@pytest.fixture(scope='session')
def ros2_bag() -> str | None:
    """Give the `ros2` command where it is on the PATH and has `ros2 bag`, else nothing."""
    ros2 = shutil.which('ros2')
    if ros2 is None or subprocess.run([ros2, 'bag', '--help'], capture_output=True).returncode:
        return None
    return ros2


@pytest.fixture(scope='session')
def kth_folder() -> Path:
    """Folder of the recorded handovers between people; the test skips where it is absent."""
    if not (KTH / 'trials.csv').is_file():
        pytest.skip('recordings of people not available')
    return KTH


@pytest.fixture(scope='session')
def kth_full_table() -> Any:
    """Give a handover recorded whole, by column; skips where it is absent."""
    # not above: one thread is told before NumPy is there
    import numpy as np

    file = DATA / 'kth_full' / 'handover_1.csv'
    if not file.is_file():
        pytest.skip('recordings of people not available')
    return np.genfromtxt(file, delimiter=',', names=True)


@pytest.fixture(scope='session')
def kth_full(kth_full_table: Any) -> Any:
    """Give the reach of a recorded handover with orientations; skips where it is absent."""
    from handover_dmp.mocap import HandoverTrial
    import numpy as np

    times = kth_full_table['t']
    reach = kth_full_table[(times >= 1.7) & (times <= 3.3)]

    def columns(who: str, axes: tuple[str, ...]) -> Any:
        return np.column_stack([reach[f'{who}_hand_{axis}'] for axis in axes])

    place, turn = ('x', 'y', 'z'), ('qx', 'qy', 'qz', 'qw')
    return HandoverTrial(
        reach['t'] - reach['t'][0],
        columns('taker', place),
        columns('giver', place),
        configuration='whole',
        partner_orientation=columns('taker', turn),
        demonstrator_orientation=columns('giver', turn),
    )
