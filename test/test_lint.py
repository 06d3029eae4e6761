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

"""Licence headers. Layout, style and types depend on their tools' versions: `make lint`."""

from __future__ import annotations

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
import subprocess
import sys
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope='module')
def headers() -> ModuleType:
    """Give the tool that adds the licence headers."""
    spec = spec_from_file_location('headers', ROOT / 'scripts' / 'add_licence_header.py')
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_licence_headers() -> None:
    run_script = [sys.executable, str(ROOT / 'scripts' / 'add_licence_header.py'), '--check']
    result = subprocess.run(run_script, capture_output=True, text=True)
    assert result.returncode == 0, '\n' + result.stdout + result.stderr


@pytest.mark.parametrize(
    'text',
    ['', '"""It."""\n', '\n\nx = 1\n', '#!/usr/bin/env python3\nx = 1\n', '# A comment.\nx = 1\n'],
)
def test_a_header_is_added_once_and_takes_nothing_away(headers: ModuleType, text: str) -> None:
    once = headers.with_header(text)
    assert headers.with_header(once) == once
    assert once.count('Copyright 2026 The handover_dmp authors') == 1
    assert [line for line in text.splitlines() if line] == [
        line for line in once.splitlines() if line and line not in headers.HEADER.splitlines()
    ]
    assert once.startswith('#!') == text.startswith('#!')


def test_a_header_of_another_holder_stays(headers: ModuleType) -> None:
    other = (
        headers.HEADER.replace('2026 The handover_dmp authors', '2024-2025 Somebody') + '\nx = 1\n'
    )
    assert headers.with_header(other) == other


def test_a_copyright_without_its_licence_is_no_header(headers: ModuleType) -> None:
    text = '# Copyright 2024 Somebody\nx = 1\n'
    assert headers.with_header(text) != text


def test_the_licence_is_the_apache_licence_that_the_headers_name(headers: ModuleType) -> None:
    licence = (ROOT / 'LICENSE').read_text(encoding='utf-8')
    assert 'Apache License\n                           Version 2.0, January 2004' in licence
    notice = [line.removeprefix('#').strip() for line in headers.HEADER.splitlines()[2:]]
    assert ' '.join(' '.join(notice).split()) in ' '.join(licence.split())
