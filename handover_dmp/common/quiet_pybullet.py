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
PyBullet without its output: it writes to the terminal from C, at import, start and loading.

`silenced` works for any C library.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import ctypes
from importlib import import_module
import os
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    import pybullet

__all__ = ['pybullet', 'silenced']


@contextmanager
def silenced() -> Iterator[None]:
    """
    Discard what C code writes to stdout and stderr while the block runs.

    It redirects the file descriptors 1 and 2 of the whole process, so keep the block short. The
    buffers of the C library are flushed before and after, lest their content appear later.
    """
    flush = ctypes.CDLL(None).fflush
    flush(None)
    kept: list[tuple[int, int]] = []
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for descriptor in (1, 2):
            try:
                kept.append((descriptor, os.dup(descriptor)))
            except OSError:  # closed, as in a daemon: nothing to silence
                continue
            os.dup2(nowhere, descriptor)
        yield
    finally:
        flush(None)
        for descriptor, copy in kept:
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(nowhere)


def __getattr__(name: str) -> Any:
    # PyBullet is loaded at its first use: `silenced` alone does not need it.
    if name != 'pybullet':
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    with silenced():
        return import_module('pybullet')
