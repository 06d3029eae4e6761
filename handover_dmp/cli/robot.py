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

"""`handover_dmp robot`: facts to check about an arm before it is moved, and a picture of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, TYPE_CHECKING

from handover_dmp.cli.options import add_json, save_json
from handover_dmp.cli.robot_arguments import add_frame_arguments, chosen_arm, WHICH

if TYPE_CHECKING:
    from handover_dmp.robot.model import RobotModel


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `robot`.

    Args:
        parser: parser of the verb.

    """
    parser.add_argument('robot', metavar='ARM', help=WHICH)
    add_frame_arguments(parser)
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE.png', help='picture of the arm at home'
    )
    add_json(parser, 'also write the numbers as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Inspect an arm.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: the arm cannot be used.

    """
    from handover_dmp.robot.model import RobotModel

    choice = chosen_arm(options)
    model = RobotModel.load(
        choice.robot, wrist_frame=choice.wrist_frame, base_frame=choice.base_frame
    )
    facts = _facts(model)
    _show(facts)
    if options.output is not None:
        from handover_dmp.view.portrait import draw_portrait
        from PIL import Image

        options.output.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(draw_portrait(model)).save(options.output)
    save_json(facts, options.json)
    return 0


def _facts(model: RobotModel) -> dict[str, Any]:
    from math import isfinite

    from handover_dmp.robot.collision import CollisionModel
    from handover_dmp.simulation.self_check import check_models

    agreement = check_models(model)
    collision = CollisionModel.of(model)
    limits, inertias = model.limits, model.pinocchio_model.inertias
    quantities = ('lower', 'upper', 'velocity', 'acceleration', 'effort')
    columns = {name: getattr(limits, name).tolist() for name in quantities}
    joints = []
    for i, name in enumerate(model.joint_names):
        numbers = {key: values[i] for key, values in columns.items()}
        joints.append(
            {
                'name': name,
                'unit': 'm' if model.slides(i) else 'rad',
                **{key: value if isfinite(value) else None for key, value in numbers.items()},
                'home': float(model.home[i]),
                'moved_mass_kg': float(inertias[i + 1].mass),
            }
        )
    return {
        'robot': model.name,
        'description': model.description.asked_for,
        'wrist_frame': model.wrist_frame,
        'base_frame': model.base_frame,
        'joints': joints,
        'limit_sources': model.limit_origins,
        'reach_m': model.reach_m,
        'meshes_found': len(model.meshes.found),
        'meshes_missing': list(model.meshes.missing),
        'meshes_unreadable': list(model.meshes.unreadable),
        'engines_apart_m': agreement.position_m,
        'engines_apart_mass': agreement.mass,
        'collision_pairs': len(collision.pairs),
        'remarks': list(model.remarks),
    }


def _show(facts: dict[str, Any]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(soft_wrap=True, highlight=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column('joint', overflow='fold')
    for head in ('position', 'velocity', 'acceleration', 'effort', 'home', 'mass'):
        table.add_column(head, no_wrap=True)
    table.add_row('', 'rad', 'rad/s', 'rad/s²', 'Nm', 'rad', 'kg')
    for joint in facts['joints']:
        endless = joint['lower'] is None or joint['upper'] is None
        table.add_row(
            joint['name'],
            'continuous'
            if endless
            else f'{joint["lower"]:.3g} … {joint["upper"]:.3g}{" m" * (joint["unit"] == "m")}',
            *(f'{joint[key]:.4g}' for key in ('velocity', 'acceleration', 'effort')),
            *(f'{joint[key]:.3g}' for key in ('home', 'moved_mass_kg')),
        )
    console.print(table)
    missing, unreadable = facts['meshes_missing'], facts['meshes_unreadable']
    lines = {
        'limits from': '; '.join(f'{k}: {v}' for k, v in facts['limit_sources'].items()),
        'wrist': facts['wrist_frame'],
        'begins at': facts['base_frame'] or 'the root',
        'reach': f'{facts["reach_m"]:.3f} m from the shoulder',
        'meshes': f'{facts["meshes_found"]} found, {len(missing)} missing, '
        f'{len(unreadable)} unreadable',
        'self-check': f'Pinocchio and PyBullet agree to {facts["engines_apart_m"]:.1e} m and '
        f'{facts["engines_apart_mass"]:.1e} of the mass matrix',
        'pairs of links kept apart': str(facts['collision_pairs']),
    }
    rows = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in lines.items():
        rows.add_row(name, value)
    console.print(rows)
    for remark in facts['remarks']:
        console.print(f'note: {remark}')
