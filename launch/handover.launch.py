"""
The handover as a graph: the simulated arm, the partner's hand, the five nodes, viewers on demand.

    ros2 launch handover_dmp handover.launch.py exchange:=take use_sim_time:=false rviz:=true

On simulated time the handover begins by itself, on the wall clock when it is told to:

    ros2 service call /hand_tracker/replay std_srvs/srv/Trigger
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
import tempfile
from typing import Any
from xml.etree import ElementTree

from handover_dmp.resources import share_path
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, OrSubstitution
from launch_ros.actions import Node

PACKAGE = 'handover_dmp'
REPLAY_AT_S = 1.0

ARGUMENTS = {
    'robot': ('lwr4', 'lwr4, iiwa14, panda, ur5 or the path of a URDF'),
    'trial': ('', 'CSV file of a recorded handover, whose partner is replayed'),
    'bag': ('', 'bag of a recorded handover, in place of a trial'),
    'exchange': ('give', 'give or take, where neither trial nor bag is given'),
    'use_sim_time': ('true', 'run in lockstep on /clock; false: on the wall clock'),
    'parameters': (str(share_path('config/handover.yaml')), 'file with those of all nodes'),
    'record': ('true', 'whether to record all topics'),
    'output': ('', 'folder for the bag; empty: runs/<date-time>_launch'),
    'rviz': ('false', 'whether to start RViz (package rviz2)'),
    'foxglove': ('false', 'whether to start the Foxglove bridge (package foxglove_bridge)'),
}


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments; what depends on their values is made by `nodes`."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, description) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=nodes),
        ]
    )


def nodes(context: LaunchContext) -> list[Node]:
    """Make the nodes, with the parameters that follow from the recording and the arm."""
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    if chosen['trial'] and chosen['bag']:
        raise RuntimeError('trial and bag exclude each other')
    folder = Path(tempfile.mkdtemp(prefix=f'{PACKAGE}_'))
    scenario, trial, model = _scenario(chosen, folder)
    simulated = chosen['use_sim_time'].lower() == 'true'
    arm = {
        'robot': chosen['robot'],
        'base_position': [float(value) for value in scenario.robot.base.position],
        'base_yaw': float(scenario.robot.base.yaw),
    }
    own: dict[str, dict[str, Any]] = {
        'robot_sim': {**arm, 'initial_positions': scenario.start_posture.tolist()},
        'hand_tracker': {'trial': trial, **({'replay_at_s': REPLAY_AT_S} if simulated else {})},
        'dmp': {'model': model},
        'priority_ik': arm,
        'recorder': {'folder': str(_output(chosen['output']) / 'bag')},
    }
    common = {'use_sim_time': simulated, 'lockstep': simulated}
    return [
        Node(
            package=PACKAGE,
            executable=name,
            name=name,
            output='screen',
            parameters=[chosen['parameters'], {**common, **parameters}],
            condition=IfCondition(chosen['record']) if name == 'recorder' else None,
            # The arm has braked by itself; four nodes without the fifth are of no use.
            on_exit=Shutdown(reason=f'{name} ended'),
        )
        for name, parameters in own.items()
    ] + _viewers(scenario.robot, simulated)


def _scenario(chosen: dict[str, str], folder: Path) -> tuple[Any, str, str]:
    """Put the run together, and leave what the nodes read in `folder`."""
    from handover_dmp.dmp import save_model
    from handover_dmp.hand import synthesize, write_trial
    from handover_dmp.scenario import EXAMPLE, make_scenario

    trial = chosen['trial'] or chosen['bag']
    if not trial:
        configuration, _ = EXAMPLE
        wanted = (configuration, chosen['exchange'])
        trials = [t for t in synthesize() if (t.configuration, t.exchange) == wanted]
        if not trials:
            raise RuntimeError(f'exchange is {chosen["exchange"]!r}, neither give nor take')
        trial = str(folder / '{0.configuration}_{0.exchange}_{0.number}.csv'.format(trials[0]))
        write_trial(trials[0], Path(trial))
    scenario = make_scenario(Path(trial), robot=chosen['robot'])
    model = folder / 'model.json'
    save_model(scenario.model, model)
    return scenario, trial, str(model)


def _output(folder: str) -> Path:
    """Return the folder of this run, made if need be."""
    path = Path(folder or f'runs/{datetime.now():%Y-%m-%d_%H-%M-%S}_launch').absolute()
    path.mkdir(parents=True, exist_ok=True)
    return path


def _viewers(robot: Any, simulated: bool) -> list[Node]:
    """Make the viewers that were asked for, and the transforms that they need."""
    wanted = IfCondition(
        OrSubstitution(LaunchConfiguration('rviz'), LaunchConfiguration('foxglove'))
    )
    x, y, z = (str(value) for value in robot.base.position)
    use_sim_time = {'use_sim_time': simulated}
    return [
        Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            parameters=[{'robot_description': robot.urdf_text}, use_sim_time],
            # `robot_sim` publishes it on /robot_description already.
            remappings=[('robot_description', '~/robot_description')],
            condition=wanted,
        ),
        Node(
            package='tf2_ros',
            executable='static_transform_publisher',
            arguments=[
                '--x', x, '--y', y, '--z', z, '--yaw', str(robot.base.yaw),
                '--frame-id', 'world', '--child-frame-id', _root_link(robot.urdf_text),
            ],
            parameters=[use_sim_time],
            condition=wanted,
        ),
        Node(
            package='rviz2',
            executable='rviz2',
            arguments=['--fixed-frame', 'world'],
            parameters=[use_sim_time],
            condition=IfCondition(LaunchConfiguration('rviz')),
        ),
        Node(
            package='foxglove_bridge',
            executable='foxglove_bridge',
            # Nothing leaves the machine unless asked for.
            parameters=[{'address': '127.0.0.1'}, use_sim_time],
            condition=IfCondition(LaunchConfiguration('foxglove')),
        ),
    ]  # fmt: skip


def _root_link(urdf_text: str) -> str:
    """Return the name of the link that no joint moves."""
    tree = ElementTree.fromstring(urdf_text)
    moved = {child.get('link') for child in tree.findall('joint/child')}
    (root,) = (link.get('name') for link in tree.findall('link') if link.get('name') not in moved)
    return str(root)
