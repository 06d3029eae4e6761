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
Launch a handover: the five nodes with a simulated arm and partner, and viewers on demand.

    ros2 launch handover_dmp handover.launch.py exchange:=take use_sim_time:=false rviz:=true

The handover begins by itself or, with `start:=service`, when this service is called:

    ros2 service call /hand_tracker/replay std_srvs/srv/Trigger

Several can be included side by side, each in a `namespace` of its own or in a group with
`PushRosNamespace`.

For tests without a display, `exit_when_done:=true` ends all nodes after the handover; the exit
code is 0 if the object was handed over.
"""

from __future__ import annotations

from functools import partial
import json
from pathlib import Path
import shlex
import sys
from tempfile import TemporaryDirectory
from typing import Any

from ament_index_python.packages import get_package_prefix, PackageNotFoundError
from handover_dmp.common.resources import share_path
from handover_dmp.topics import FRAME, TOPICS
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = 'handover_dmp'
NODES = ('recorder', 'hand_tracker', 'dmp', 'priority_ik', 'robot_sim')
END_S = '20.0'
"""Time for a node to end, s; longer than its own time-out (`nodes/spin.py`)."""
BOOLEAN = ('true', 'false', 'True', 'False', '1', '0')
ARGUMENTS: dict[str, tuple[str, str, tuple[str, ...] | None]] = {
    'namespace': (
        '',
        'namespace of all nodes, topics and services, below that of the group',
        None,
    ),
    'robot': ('lwr4', 'robot: lwr4, iiwa14, panda, ur5 or the path of a URDF or xacro file', None),
    'wrist_frame': ('', 'link that follows the wrist; empty: found from the description', None),
    'base_frame': ('', 'first link of the arm; empty: the root', None),
    'trial': ('', 'CSV file of a recorded handover; its partner is replayed', None),
    'bag': ('', 'bag of a recorded handover, in place of a trial', None),
    'from': ('', 'start of the handover in the bag, s; empty: detected', None),
    'to': ('', 'end of the handover in the bag, s; empty: detected', None),
    'exchange': ('give', 'direction, if neither trial nor bag is given', ('give', 'take')),
    'object': ('rod', 'object: rod, cup, knife, box, or a .yaml file with one', None),
    'use_sim_time': (
        'true',
        'whether to run in lockstep on /clock; false: on the wall clock',
        BOOLEAN,
    ),
    'start': (
        'auto',
        'start of the handover: auto (when all nodes are there) or service (/hand_tracker/replay)',
        ('auto', 'service'),
    ),
    'exit_when_done': ('false', 'whether all nodes end after the handover', BOOLEAN),
    'parameters': (
        str(share_path('config/handover.yaml')),
        'file with the parameters of all nodes',
        None,
    ),
    'record': ('true', 'whether to record all topics', BOOLEAN),
    'output': ('', 'folder of the run; empty: runs/<date-time>_<exchange>_<configuration>', None),
    'rviz': ('false', 'whether to start RViz (package rviz2)', BOOLEAN),
    'foxglove': ('false', 'whether to start the bridge (package foxglove_bridge)', BOOLEAN),
}
VIEWERS = {
    'rviz': ('tf2_msgs', 'rviz2'),
    'foxglove': ('tf2_msgs', 'foxglove_bridge'),
}
"""Launch argument to the packages that it needs."""


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments; `nodes` makes everything that depends on their values."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name, default_value=default, description=description, choices=choices
                )
                for name, (default, description, choices) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context: LaunchContext) -> list[Node]:
    """Make the nodes, with the parameters that follow from the recording and the arm."""
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    look_up(chosen)
    own = prepare(chosen)
    simulated = _is_true(chosen['use_sim_time'])
    graph = [
        Node(
            package=PACKAGE,
            executable=name,
            name=name,
            output='screen',
            # Both files have sections for this node in any namespace. A dictionary in place of the
            # second would be a section for all nodes, which yields to those.
            namespace=chosen['namespace'] or None,
            parameters=[chosen['parameters'], str(own)],
            # In lockstep every graph has its own time.
            remappings=[('/clock', 'clock')] if simulated else [],
            condition=IfCondition(chosen['record']) if name == 'recorder' else None,
            # The arm brakes by itself; four nodes are useless without the fifth.
            on_exit=partial(end, name),
            sigterm_timeout=END_S,
            sigkill_timeout=END_S,
        )
        for name in NODES
    ]
    frame = frame_of(chosen)
    write_layout(own.parent, frame)
    return graph + viewers(own.parent, chosen['namespace'], simulated, frame)


def end(name: str, event: ProcessExited, _context: LaunchContext) -> Shutdown:
    """End all nodes when one has ended; if it failed, the launch fails."""
    if event.returncode:
        raise RuntimeError(f'{name} ended with exit code {event.returncode}')
    return Shutdown(reason=f'{name} ended')


def look_up(chosen: dict[str, str]) -> None:
    """
    Check for missing packages and files, before anything starts.

    Args:
        chosen: value of each launch argument.

    Raises:
        RuntimeError: a package that a viewer needs is not installed, or a file is missing.

    """
    for viewer, packages in VIEWERS.items():
        missing = [name for name in packages if _is_true(chosen[viewer]) and not _has(name)]
        if missing:
            names = ' '.join(f'ros-jazzy-{name.replace("_", "-")}' for name in missing)
            raise RuntimeError(f'{viewer}:=true needs {", ".join(missing)}: apt install {names}')
    if not Path(chosen['parameters']).is_file():
        raise RuntimeError(f'parameters:={chosen["parameters"]}: no such file')


def prepare(chosen: dict[str, str]) -> Path:
    """
    Set up the run and make its folder.

    Args:
        chosen: value of each launch argument.

    Returns:
        The file of the parameters that override the user's.

    """
    from handover_dmp.handover.lockstep import REPLAY_AT_S
    from handover_dmp.nodes.graph import write_node_parameters
    from handover_dmp.nodes.run_graph import graph_parameters
    from handover_dmp.runs.folder import keep_inputs, new_run_folder, run_info

    scenario = _scenario(chosen)
    output, trial = Path(chosen['output']) if chosen['output'] else None, scenario.trial
    folder = new_run_folder(output, trial.direction, trial.configuration).absolute()
    keep_inputs(folder, scenario)
    simulated = _is_true(chosen['use_sim_time'])
    info = run_info(scenario, 1.0) | {'command': shlex.join(['ros2', *sys.argv[1:]])}
    parameters = graph_parameters(folder, scenario, info, simulated)
    # In real time, for people to watch.
    del parameters['robot_sim']['real_time_factor']
    for name, own in parameters.items():
        own['lockstep'] = simulated
        # `robot_sim` publishes the time of the others.
        own['use_sim_time'] = simulated and name != 'robot_sim'
    by_itself = chosen['start'] == 'auto'
    parameters['hand_tracker']['replay_at_s'] = REPLAY_AT_S if by_itself else -1.0
    parameters['dmp']['exit_when_done'] = _is_true(chosen['exit_when_done'])
    file = folder / 'parameters.yaml'
    write_node_parameters(file, parameters)
    return file


def frame_of(chosen: dict[str, str]) -> str:
    """Return the frame of all positions, by the user's parameters."""
    from handover_dmp.common.plain_yaml import load_plain
    from handover_dmp.common.ros_parameters import merged, sections
    from handover_dmp.common.settings import defaults

    told = sections(load_plain(Path(chosen['parameters']).read_text(encoding='utf-8')))
    node = f'/{chosen["namespace"].strip("/")}/dmp'.replace('//', '/')
    return str(merged(told, node).get('frame', defaults('dmp')['frame']))


def write_layout(folder: Path, frame: str) -> None:
    """Write a layout for Foxglove into the folder of the run, if its frame is not the default."""
    layout = share_path('config/handover.foxglove.json')
    if frame == FRAME:
        return
    text = layout.read_text(encoding='utf-8')
    for key in ('followTf', 'frameId'):
        text = text.replace(f'"{key}": "{FRAME}"', f'"{key}": {json.dumps(frame)}')
    (folder / layout.name).write_text(text, encoding='utf-8')


def viewers(folder: Path, namespace: str, simulated: bool, frame: str) -> list[Node]:
    """Make the requested viewers; `robot_sim` publishes the transforms they need."""
    use_sim_time = {'use_sim_time': simulated}
    own_time = [('/clock', 'clock')] if simulated else []
    # RViz has only absolute names in its files.
    shown = [(topic.name, topic.relative) for topic in TOPICS if not topic.is_global]
    return [
        Node(
            package='rviz2',
            executable='rviz2',
            namespace=namespace or None,
            arguments=['-d', str(rviz_file(folder, namespace)), '-f', frame],
            parameters=[use_sim_time],
            remappings=[*shown, *own_time],
            condition=IfCondition(LaunchConfiguration('rviz')),
        ),
        Node(
            package='foxglove_bridge',
            executable='foxglove_bridge',
            namespace=namespace or None,
            # Nothing leaves the machine unless requested.
            parameters=[{'address': '127.0.0.1'}, use_sim_time],
            remappings=own_time,
            condition=IfCondition(LaunchConfiguration('foxglove')),
        ),
    ]


def rviz_file(folder: Path, namespace: str) -> Path:
    """Return the file for RViz; in a namespace a copy, since its links have a prefix."""
    file = share_path('config/handover.rviz')
    if not namespace.strip('/'):
        return file
    own = folder / file.name
    prefix = f'TF Prefix: {namespace.strip("/")}'
    own.write_text(file.read_text(encoding='utf-8').replace('TF Prefix: ""', prefix), 'utf-8')
    return own


def _scenario(chosen: dict[str, str]) -> Any:
    """Read the recording, or learn from one synthetic handover and replay another."""
    from handover_dmp.dmp import save_model
    from handover_dmp.handover.object_profile import object_profile
    from handover_dmp.handover.recordings import EXAMPLE
    from handover_dmp.handover.scenario import make_scenario
    from handover_dmp.handover.teaching import learn_from_trials
    from handover_dmp.mocap import condition, synthesize, write_trial
    from handover_dmp.robot.descriptions import ArmChoice

    if chosen['trial'] and chosen['bag']:
        raise RuntimeError('trial and bag exclude each other')
    carried = object_profile(chosen['object'])
    arm = ArmChoice(*(chosen[key] for key in ('robot', 'wrist_frame', 'base_frame')))
    if recorded := chosen['trial'] or chosen['bag']:
        scenario = make_scenario(Path(recorded), arm=arm, span_s=_span_s(chosen), carried=carried)
        trial = scenario.trial
        print(f'handover.launch.py: replays {trial.source}: {trial.duration_s:.2f} s', flush=True)
        return scenario
    _span_s(chosen)
    wanted = (EXAMPLE[0], chosen['exchange'])
    trials = [t for t in synthesize() if (t.configuration, t.direction) == wanted]
    with TemporaryDirectory() as folder:
        model = Path(folder) / 'model.json'
        save_model(learn_from_trials([condition(trials[0])]), model)
        trial = Path(folder) / f'{"_".join(wanted)}_{trials[1].number}.csv'
        write_trial(trials[1], trial)
        return make_scenario(trial, model=model, arm=arm, carried=carried)


def _span_s(chosen: dict[str, str]) -> tuple[float, float] | None:
    """Read the start and end of the handover in a bag."""
    words = chosen['from'], chosen['to']
    if not any(words):
        return None
    if not (all(words) and chosen['bag']):
        raise RuntimeError('from and to must be given together, and with bag')
    try:
        begin_s, end_s = map(float, words)
    except ValueError as error:
        raise RuntimeError(f'from:={words[0]} to:={words[1]}: expected two times in s') from error
    if not begin_s < end_s:
        raise RuntimeError(f'from:={words[0]} to:={words[1]}: to must be later than from')
    return begin_s, end_s


def _has(package: str) -> bool:
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        return False
    return True


def _is_true(word: str) -> bool:
    return word.lower() in ('true', '1')
