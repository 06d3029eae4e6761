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
Fuzzing of all readers: any file must give a value or one of our errors.

`handover_dmp bench fuzz` uses libFuzzer through `atheris` to search for files that give a
traceback, take longer than ten seconds or more than 500 MB. Each reader has its own process,
guided by the coverage of the reader's code and seeded with good files. The tests give files
damaged by hypothesis to the same readers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
import re
import subprocess
import sys
import tempfile
from time import monotonic, sleep

from handover_dmp.bench import fuzz_examples
from handover_dmp.bench.measurement import Measurement
from handover_dmp.common.errors import HandoverError
from handover_dmp.mocap.markers import MarkerRecording

INPUTS = 1_000_000
MINUTES = 60.0
HANG_S = 10
MAX_MB = 500
INSTRUMENTED = ['handover_dmp', 'c3d', 'mcap', 'mcap_ros2', 'yaml', 'csv']
_MAX_INPUT = 16_384


@dataclass(frozen=True)
class FuzzedReader:
    """
    A reader and its files.

    Attributes:
        module: module of the function.
        function: function that reads a path.
        file: required file name.
        share: share of all inputs; slow readers get less.
        examples: makes good files as seeds.
        in_folder: whether the function takes the folder of the file instead.
        beside: makes the other files of that folder, content by name.

    """

    module: str
    function: str
    file: str
    share: float
    examples: Callable[[], list[bytes]]
    in_folder: bool = False
    beside: Callable[[], dict[str, bytes]] = dict

    def place_in(self, folder: Path) -> Path:
        """
        Write the other files into a folder.

        Args:
            folder: the folder.

        Returns:
            The path for the file.

        """
        for name, content in self.beside().items():
            (folder / name).write_bytes(content)
        return folder / self.file

    def read(self, path: Path) -> bool:
        """
        Read a file.

        Args:
            path: the file, named `file`.

        Returns:
            Whether it was readable; if not, the documented error was raised.

        """
        read = getattr(import_module(self.module), self.function)
        try:
            found = read(path.parent if self.in_folder else path)
            # Readers of bags are iterators over messages.
            if hasattr(found, '__next__'):
                for _ in found:
                    pass
            if isinstance(found, MarkerRecording):
                found.wrists(found.names[:1], found.names[-1:])
        except HandoverError as error:
            if '\n' in str(error):
                raise AssertionError(f'an error of more than one line: {error!r}') from error
            return False
        return True


READERS = {
    'trial CSV': FuzzedReader(
        'handover_dmp.mocap', 'read_trial', 'a_give_1.csv', 0.15, fuzz_examples.trial_csv
    ),
    'data set CSV': FuzzedReader(
        'handover_dmp.mocap', 'read_data_set', 'trials.csv', 0.05, fuzz_examples.data_set_csv,
        in_folder=True, beside=lambda: {'a_give_1.csv': fuzz_examples.trial_csv()[0]},
    ),
    'Qualisys TSV': FuzzedReader(
        'handover_dmp.mocap.qualisys', 'read_qualisys', 'a.tsv', 0.15, fuzz_examples.qualisys_tsv
    ),
    'C3D': FuzzedReader('handover_dmp.mocap.c3d', 'read_c3d', 'a.c3d', 0.15, fuzz_examples.c3d),
    'Motive CSV': FuzzedReader(
        'handover_dmp.mocap.motive', 'read_motive', 'a.csv', 0.1, fuzz_examples.motive_csv
    ),
    'Vicon text': FuzzedReader(
        'handover_dmp.mocap.vicon', 'read_vicon', 'a.csv', 0.1, fuzz_examples.vicon_text
    ),
    'TRC': FuzzedReader('handover_dmp.mocap.trc', 'read_trc', 'a.trc', 0.07, fuzz_examples.trc),
    'wrists of an MCAP bag': FuzzedReader(
        'handover_dmp.mocap.bag', 'read_bag_wrists', 'bag_0.mcap', 0.03, fuzz_examples.wrist_bag
    ),
    'wrists of a sqlite3 bag': FuzzedReader(
        'handover_dmp.mocap.bag', 'read_bag_wrists', 'bag_0.db3', 0.03, fuzz_examples.sqlite3_bag
    ),
    'wrists of a compressed bag': FuzzedReader(
        'handover_dmp.mocap.bag', 'read_bag_wrists', 'bag_0.mcap.zstd', 0.02,
        fuzz_examples.compressed_bag,
    ),
    'MCAP': FuzzedReader(
        'handover_dmp.recording', 'read_bag', 'bag_0.mcap', 0.05, fuzz_examples.mcap
    ),
    'bag metadata YAML': FuzzedReader(
        'handover_dmp.recording.bag_metadata', 'read_metadata', 'metadata.yaml', 0.02,
        fuzz_examples.bag_metadata, in_folder=True,
    ),
    'model JSON': FuzzedReader(
        'handover_dmp.dmp', 'load_model', 'model.json', 0.05, fuzz_examples.model_json
    ),
    'parameter YAML': FuzzedReader(
        'handover_dmp.dmp.parameter_file', 'read_parameters', 'parameters.yaml', 0.03,
        fuzz_examples.parameter_yaml,
    ),
}  # fmt: skip


def run(
    progress: Callable[[str], None], minutes: float = MINUTES, inputs: int = INPUTS
) -> list[Measurement]:
    """
    Fuzz every reader.

    Args:
        progress: called with the name of each reader.
        minutes: time limit of all readers together, min.
        inputs: number of files of all readers together.

    Returns:
        Inputs, crashes and greatest memory of each reader.

    """
    import_module('atheris')
    figures: list[Measurement] = []
    end_s = monotonic() + 60.0 * minutes
    total = crashes = 0
    worst_mb = 0.0
    for name, reader in READERS.items():
        count = round(inputs * reader.share)
        begun_s = monotonic()
        seconds = max(1, round(end_s - begun_s))
        outcome = _fuzz(name, count, seconds, progress)
        total += outcome.inputs
        crashes += bool(outcome.fault)
        worst_mb = max(worst_mb, outcome.peak_mb)
        note = outcome.fault or f'{outcome.inputs / (monotonic() - begun_s):.0f} a second'
        figures.append(Measurement(f'fuzz: {name}', outcome.inputs, 'inputs', note=note))
    return [
        *figures,
        Measurement('fuzz: inputs', total, 'inputs', target=inputs, higher_is_better=True),
        Measurement('fuzz: tracebacks, hangs', crashes, 'readers', target=0.0),
        Measurement(
            'fuzz: most memory', worst_mb, 'MB', target=MAX_MB, note='with Python and libraries'
        ),
    ]


@dataclass(frozen=True)
class Outcome:
    """
    The result of fuzzing one reader.

    Attributes:
        inputs: number of files read.
        peak_mb: peak memory of its process, MB.
        fault: the last error; empty if there was none.

    """

    inputs: int
    peak_mb: float
    fault: str


def _fuzz(name: str, count: int, seconds: int, progress: Callable[[str], None]) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        corpus = Path(folder) / 'corpus'
        corpus.mkdir()
        for number, example in enumerate(READERS[name].examples()):
            (corpus / f'example_{number}').write_bytes(example)
        log = Path(folder) / 'log'
        with log.open('wb') as stream:
            process = subprocess.Popen(
                [
                    sys.executable, '-m', 'handover_dmp.bench.fuzz', name, str(corpus),
                    f'-runs={count}', f'-max_total_time={seconds}', f'-timeout={HANG_S}',
                    f'-rss_limit_mb={MAX_MB}', f'-max_len={_MAX_INPUT}', '-seed=1',
                    '-print_final_stats=1', f'-artifact_prefix={folder}/',
                ],
                stdout=stream,
                stderr=stream,
            )  # fmt: skip
            while process.poll() is None:
                progress(f'{name}: {_last(r"^#([0-9]+)", log):.0f} of {count}')
                sleep(1.0)
        words = log.read_text(encoding='utf-8', errors='replace')
        fault = '' if process.returncode == 0 else _fault(words, Path(folder), process.returncode)
        return Outcome(
            int(_last(r'number_of_executed_units: *([0-9]+)', log)),
            _last(r'peak_rss_mb: *([0-9]+)', log),
            fault,
        )


def _last(pattern: str, log: Path) -> float:
    words = log.read_text(encoding='utf-8', errors='replace')
    found = re.findall(pattern, words, re.MULTILINE)
    return float(found[-1]) if found else 0.0


def _fault(words: str, folder: Path, code: int) -> str:
    """Return the error and its input."""
    said = re.search(r'Uncaught Python exception: ===\n(.*)|ERROR: (.*)', words)
    reason = said.group(1) or said.group(2) if said else f'ended with code {code}'
    place = re.findall(r'^  File "(.*)", line ([0-9]+)', words, re.MULTILINE)
    where = f' at {Path(place[-1][0]).name}:{place[-1][1]}' if place else ''
    kinds = ('crash', 'timeout', 'oom')
    found = [path for kind in kinds for path in folder.glob(f'{kind}-*')]
    content = f' with {found[0].read_bytes()[:2000]!r}' if found else ''
    return reason + where + content


def _fuzz_here(name: str, arguments: list[str]) -> None:
    """Run as the process that libFuzzer drives; never returns."""
    import atheris

    reader = READERS[name]
    path = reader.place_in(Path(tempfile.mkdtemp(dir=Path(arguments[0]).parent)))
    # Read once before, because packages load their modules on first use.
    with atheris.instrument_imports(include=INSTRUMENTED):
        for example in Path(arguments[0]).iterdir():
            path.write_bytes(example.read_bytes())
            reader.read(path)

    def read(data: bytes) -> None:
        path.write_bytes(data)
        reader.read(path)

    atheris.Setup([sys.argv[0], *arguments], read)
    atheris.Fuzz()


if __name__ == '__main__':
    _fuzz_here(sys.argv[1], sys.argv[2:])
