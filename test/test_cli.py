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

"""The command as a whole: help, version, exit codes, one line for each error."""

from __future__ import annotations

from importlib import import_module
import os
from pathlib import Path
import resource
import subprocess
import sys

from handover_dmp import __version__
from handover_dmp.cli.main import main, VERBS
import pytest


def run(*words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command as a user does."""
    return subprocess.run(
        [sys.executable, '-m', 'handover_dmp', *words],
        capture_output=True,
        text=True,
        cwd=folder,
        timeout=120,
    )


def test_help_names_every_verb_and_what_it_does() -> None:
    result = run('--help')
    assert result.returncode == 0
    assert result.stderr == ''
    words = ' '.join(result.stdout.split())
    for verb, purpose in VERBS.items():
        assert f'{verb} {purpose}' in words


def test_version() -> None:
    result = run('--version')
    assert (result.returncode, result.stdout) == (0, f'{__version__}\n')


@pytest.mark.parametrize('verb', VERBS)
def test_help_of_a_verb(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_info:
        main([verb, '--help'])
    assert exit_info.value.code == 0
    text = capsys.readouterr().out
    assert text.startswith(f'usage: handover_dmp {verb}')
    assert '--json' in text


@pytest.mark.parametrize(
    'words', [[], ['juggle'], ['--juggle'], ['learn', '--juggle'], ['--', 'learn']]
)
def test_wrong_usage_is_exit_code_2_without_traceback(words: list[str]) -> None:
    result = run(*words)
    assert result.returncode == 2
    assert result.stdout == ''
    assert result.stderr.startswith('usage: handover_dmp')
    assert 'Traceback' not in result.stderr
    assert 'error: ' in result.stderr.splitlines()[-1]


def test_option_of_the_command_before_the_verb_does_not_hide_the_verb() -> None:
    assert run('--version', 'learn').stdout == f'{__version__}\n'


@pytest.mark.parametrize(
    ('content', 'named'),
    [
        (None, 'trial.csv'),
        ('', 'trial.csv'),
        ('t,p1_x,p1_y,p1_z,p2_x,p2_y,p2_z\n0.0,one,0,0,0,0,0\n', 'line 2'),
    ],
    ids=['missing', 'empty', 'not a number'],
)
def test_bad_input_is_one_line_that_names_file_and_fault(
    tmp_path: Path, content: str | None, named: str
) -> None:
    if content is not None:
        (tmp_path / 'trial.csv').write_text(content)
    before = set(tmp_path.iterdir())
    result = run('learn', 'trial.csv', '-o', 'model.json', folder=tmp_path)
    assert result.returncode in (1, 2)
    assert result.stdout == ''
    (line,) = result.stderr.splitlines()
    assert line.startswith('handover_dmp learn: ')
    assert 'trial.csv' in line
    assert named in line
    assert set(tmp_path.iterdir()) == before


def test_every_verb_has_a_module_of_one_form() -> None:
    for verb in VERBS:
        module = import_module(f'handover_dmp.cli.{"import_verb" if verb == "import" else verb}')
        assert callable(module.add_arguments)
        assert callable(module.run)


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / 'pipe.json'
    os.mkfifo(pipe)
    writing = (
        'import sys; from pathlib import Path; from handover_dmp.common.files import write_text; '
    )
    writing += "write_text(Path(sys.argv[1]), 'all of it')"
    with subprocess.Popen([sys.executable, '-c', writing, str(pipe)]) as process:
        assert pipe.read_text(encoding='utf-8') == 'all of it'
    assert process.returncode == 0
    assert pipe.is_fifo()


def test_a_full_disk_is_one_line_that_names_the_file(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, '-B', '-m', 'handover_dmp', 'figure1', '-o', 'curve.png'],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=120,
        # what measures coverage would have no room either
        env={name: value for name, value in os.environ.items() if 'COVERAGE' not in name},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
    )
    assert result.returncode == 1
    assert result.stderr == 'handover_dmp figure1: curve.png: File too large\n'
    assert list(tmp_path.iterdir()) == []
