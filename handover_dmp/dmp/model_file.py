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

"""Model files: one JSON document; numbers are stored exactly."""

from __future__ import annotations

from dataclasses import asdict, fields
import json
from math import isfinite
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
from handover_dmp.dmp.basis import Basis
from handover_dmp.dmp.classical import ClassicalDmp
from handover_dmp.dmp.decoupled import DecoupledDmp
from handover_dmp.dmp.orientation import LearntTurn
from handover_dmp.dmp.parameters import DmpParameters
from handover_dmp.dmp.posterior import WeightPosterior
from handover_dmp.dmp.primitive import Primitive
import numpy as np

FORMAT = 'handover_dmp model'
VERSION = 4
KINDS: dict[str, type[Primitive]] = {'decoupled': DecoupledDmp, 'classical': ClassicalDmp}
UNITS = {
    'duration': 's',
    'start': 'm',
    'goal': 'm',
    'goal_offset': 'm',
    'start_velocity': 'm/s',
    'partner_path': 'm',
    'turn': 'rad; start: quaternion x, y, z, w; start_velocity: rad/s',
    'weights': 'm',
    'covariance': 'm^2',
    'goal_velocity_gain': 's; negative: damping times duration',
    'mu': 'duration',
    'sigma': 'duration',
}

LARGEST_FILE_BYTES = 64_000_000
MAX_BASIS = 10_000
MAX_DIMENSIONS = 100
MAX_PATH = 10_000


def save_model(model: Primitive, path: Path | str) -> None:
    """
    Write a model file.

    Args:
        model: decoupled or classical.
        path: file to write.

    """
    document = {'format': FORMAT, 'version': VERSION, 'units': UNITS, **_describe(model)}
    text = json.dumps(document, default=np.ndarray.tolist, allow_nan=False, indent=1)
    write_text(Path(path), text + '\n')


def _describe(model: Primitive) -> dict[str, Any]:
    kind = next(name for name, known in KINDS.items() if type(model) is known)
    return {
        'kind': kind,
        'source': model.source,
        'parameters': asdict(model.parameters),
        'duration': model.duration_s,
        'start': model.start,
        'start_velocity': model.start_velocity,
        'goal': model.goal,
        'goal_offset': model.goal_offset,
        'basis': {'centres': model.basis.centres, 'sharpness': model.basis.sharpness},
        'weights': model.weights,
        'covariance': model.covariance and [vars(each) for each in model.covariance],
        'partner_path': model.partner_path,
        'way_back': model.way_back and _describe(model.way_back),
        'turn': model.turn and vars(model.turn),
    }


def load_model(path: Path | str) -> Primitive:
    """
    Read a model file of the current or an older version.

    Args:
        path: file to read.

    Returns:
        The model; floats are read back exactly.

    Raises:
        DataError: the file cannot be read, has an unknown version, or does not hold a valid
            model.

    """
    path = Path(path)
    document = _parse(path)
    try:
        return _build(_current(document))
    except DataError as error:
        raise DataError(f'{path}: {error}') from error


def _parse(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > LARGEST_FILE_BYTES:
            raise DataError(f'{path}: larger than {LARGEST_FILE_BYTES // 1_000_000} MB')
        document = json.loads(path.read_text(encoding='utf-8'), parse_constant=_refuse)
    except OSError as error:
        raise DataError(f'{path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise DataError(f'{path}: not a text file') from error
    except json.JSONDecodeError as error:
        raise DataError(f'{path}, line {error.lineno}: not JSON: {error.msg}') from error
    except (RecursionError, ValueError) as error:
        raise DataError(f'{path}: {_first_line(error)}') from error
    if not isinstance(document, dict) or document.get('format') != FORMAT:
        raise DataError(f'{path}: not a model file (no "format": "{FORMAT}")')
    return document


def _refuse(constant: str) -> float:
    raise ValueError(f'holds {constant}, which is not a finite number')


def _first_line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).splitlines()[0][:200]


def _current(document: dict[str, Any]) -> dict[str, Any]:
    """Convert a document of an older version to the current one."""
    version = document.get('version')
    if type(version) is not int or not 1 <= version <= VERSION:
        known = ', '.join(str(each) for each in range(1, VERSION + 1))
        raise DataError(f'model version {str(version)[:40]} is unknown; known: {known}')
    if version < 2:
        start = document.get('start')
        still = [0.0] * len(start) if isinstance(start, list) else []
        document = {'start_velocity': still, **document, 'kind': 'decoupled'}
    if version < 3:
        document = {**document, 'partner_path': None}
    if version < 4:
        document = {**document, 'way_back': None, 'turn': None}
    return document


def _build(document: dict[str, Any]) -> Primitive:
    kind = document.get('kind')
    if not isinstance(kind, str) or kind not in KINDS:
        raise DataError(f'kind {str(kind)[:40]!r} is unknown; known: {", ".join(KINDS)}')
    start = _array(document, 'start', (None,), MAX_DIMENSIONS)
    basis = _member(document, 'basis', dict)
    centres = _array(basis, 'centres', (None,), MAX_BASIS)
    sharpness = _array(basis, 'sharpness', (centres.size,))
    if not centres.size or not start.size:
        raise DataError('a model needs at least one dimension and one basis function')
    if (sharpness <= 0.0).any():
        raise DataError('sharpness must be above 0')
    if (np.abs(centres) > 10.0).any() or (sharpness > 1e30).any():
        raise DataError('the basis functions are outside the range of the phase')
    vector = (start.size,)
    return KINDS[kind](
        _parameters(_member(document, 'parameters', dict)),
        _number(document, 'duration'),
        start,
        _array(document, 'goal', vector),
        _array(document, 'weights', (centres.size, start.size)),
        Basis(centres, sharpness),
        goal_offset=_array(document, 'goal_offset', vector),
        start_velocity=_array(document, 'start_velocity', vector),
        covariance=_covariance(document.get('covariance'), start.size, centres.size),
        source=_member(document, 'source', str)[:10_000],
        partner_path=_partner_path(document, start.size),
        way_back=_way_back(document),
        turn=_turn(document, centres.size),
    )


def _parameters(document: dict[str, Any]) -> DmpParameters:
    names = {each.name for each in fields(DmpParameters)}
    if unknown := sorted(set(document) - names):
        raise DataError(f'unknown parameter {unknown[0][:40]!r}')
    if missing := sorted(names - set(document)):
        raise DataError(f'parameter {missing[0]} is missing')
    values: dict[str, Any] = {
        name: _member(document, name, str) if name == 'formulation' else _number(document, name)
        for name in names
    }
    return DmpParameters(**values)


def _covariance(document: Any, dimensions: int, size: int) -> tuple[WeightPosterior, ...] | None:
    if document is None:
        return None
    if not isinstance(document, list) or len(document) != dimensions:
        raise DataError(f'covariance must be null or have {dimensions} entries')
    posteriors = []
    for entry in document:
        if not isinstance(entry, dict):
            raise DataError('an entry of covariance is not an object')
        active = _array(entry, 'active', (None,), size)
        if (active != np.floor(active)).any() or (active < 0).any() or (active >= size).any():
            raise DataError('covariance names a basis function that does not exist')
        if np.unique(active).size != active.size:
            raise DataError('covariance names a basis function twice')
        matrix = _array(entry, 'matrix', (active.size, active.size))
        posteriors.append(WeightPosterior(active.astype(np.int64), matrix))
    return tuple(posteriors)


def _partner_path(document: dict[str, Any], dimensions: int) -> Array | None:
    if 'partner_path' in document and document['partner_path'] is None:
        return None
    return _array(document, 'partner_path', (None, dimensions), MAX_PATH)


def _way_back(document: dict[str, Any]) -> Primitive | None:
    if 'way_back' in document and document['way_back'] is None:
        return None
    way_back = _member(document, 'way_back', dict)
    if way_back.get('way_back') is not None:
        raise DataError('the way back has a way back')
    return _build(way_back)


def _turn(document: dict[str, Any], size: int) -> LearntTurn | None:
    if 'turn' in document and document['turn'] is None:
        return None
    turn = _member(document, 'turn', dict)
    return LearntTurn(
        _array(turn, 'start', (4,)),
        _array(turn, 'goal', (3,)),
        _array(turn, 'weights', (size, 3)),
        _array(turn, 'start_velocity', (3,)),
    )


def _member(document: dict[str, Any], name: str, kind: type) -> Any:
    if name not in document:
        raise DataError(f'{name} is missing')
    if not isinstance(document[name], kind):
        raise DataError(f'{name} is not {_KIND_NAMES[kind]}')
    return document[name]


_KIND_NAMES: dict[type, str] = {dict: 'an object', str: 'a text', list: 'a list'}


def _number(document: dict[str, Any], name: str) -> float:
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f'{name} is missing' if value is None else f'{name} is not a number')
    return _finite(value, name)


def _finite(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f'{name} holds something that is not a number')
    try:
        number = float(value)
    except OverflowError:
        number = float('inf')
    if not isfinite(number):
        raise DataError(f'{name} holds a number that is not finite')
    return number


def _array(
    document: dict[str, Any], name: str, shape: tuple[int | None, ...], maximum: int = MAX_BASIS
) -> Array:
    """Read nested lists of numbers of one shape; None stands for any length up to `maximum`."""
    values = _member(document, name, list)
    count = len(values) if shape[0] is None else shape[0]
    if len(values) != count or count > maximum:
        wanted = f'at most {maximum}' if shape[0] is None else str(count)
        raise DataError(f'{name} has {len(values)} entries instead of {wanted}')
    if len(shape) == 1:
        return np.array([_finite(value, name) for value in values], dtype=float)
    rows = []
    for row in values:
        if not isinstance(row, list) or len(row) != shape[1]:
            raise DataError(f'{name} has a row that is not of {shape[1]} numbers')
        rows.append([_finite(value, name) for value in row])
    return np.array(rows, dtype=float).reshape(count, shape[1] or 0)
