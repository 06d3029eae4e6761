"""The ROS parameter file that `tune` writes, and `learn`, `evaluate` and the `dmp` node read."""

from __future__ import annotations

from dataclasses import asdict, fields, replace
from pathlib import Path

from handover_dmp.dmp import DmpParameters
from handover_dmp.errors import DataError
from handover_dmp.files import write_text
import yaml

NODE = 'dmp'


def write_parameters(parameters: DmpParameters, path: Path, comment: str = '') -> None:
    """
    Write the parameters of the primitive for `--params-file` and `--parameters`.

    Args:
        parameters: what to write.
        path: the file.
        comment: lines to put above, without the sign of a comment.

    """
    tree = {NODE: {'ros__parameters': asdict(parameters)}}
    head = ''.join(f'# {line}'.rstrip() + '\n' for line in comment.splitlines())
    write_text(path, head + yaml.safe_dump(tree, sort_keys=False))


def read_parameters(path: Path) -> DmpParameters:
    """
    Read the parameters of the primitive from a ROS parameter file.

    Args:
        path: the file; parameters of the node that do not belong to the primitive are passed by,
            those that are not named have their defaults.

    Returns:
        The parameters.

    Raises:
        DataError: the file is missing, is no ROS parameter file with a section `dmp`, or a
            parameter is out of its range.

    """
    try:
        tree = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f'{path}: cannot be read: {error}') from error
    except yaml.YAMLError as error:
        raise DataError(f'{path}: not YAML: {" ".join(str(error).split())}') from error
    try:
        section = tree[NODE]['ros__parameters']
        known = {field.name for field in fields(DmpParameters)}
        given = {name: value for name, value in section.items() if name in known}
    except (KeyError, TypeError, AttributeError) as error:
        raise DataError(f'{path}: no section {NODE}: ros__parameters:') from error
    try:
        return replace(DmpParameters(), **given)
    except DataError as error:
        raise DataError(f'{path}: {error}') from error
