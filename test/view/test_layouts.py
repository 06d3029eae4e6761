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

"""What RViz and Foxglove are told to show is there to be shown, in the type that they expect."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
import json
from pathlib import Path
import re
from typing import Any

from handover_dmp.handover.lockstep import simulate
from handover_dmp.handover.scenario import make_scenario
from handover_dmp.recording import bag_information, read_bag
from handover_dmp.runs.bag import write_run_bag
from handover_dmp.topics import FRAME, OBJECT_POSE, PHASE, Quality, TOPICS
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
BY_NAME = {topic.name: topic for topic in TOPICS}
# What the displays of RViz and the panels of Foxglove take.
RVIZ_TYPES = {
    'rviz_default_plugins/RobotModel': 'std_msgs/msg/String',
    'rviz_default_plugins/MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'rviz_default_plugins/Pose': 'geometry_msgs/msg/PoseStamped',
    'rviz_default_plugins/PoseWithCovariance': 'geometry_msgs/msg/PoseWithCovarianceStamped',
}
# of a frame of scale 1 in Lichtblick; the scale of a pose is its length in metres
LENGTH_OF_AN_AXIS_M = 0.2
SHOWN_IN_3D = {
    'geometry_msgs/msg/PoseStamped',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    'visualization_msgs/msg/MarkerArray',
    'std_msgs/msg/String',
}


@pytest.fixture(scope='module')
def rviz() -> dict[str, Any]:
    text = (ROOT / 'config' / 'handover.rviz').read_text(encoding='utf-8')
    return yaml.safe_load(text)['Visualization Manager']


@pytest.fixture(scope='module')
def foxglove() -> dict[str, Any]:
    return json.loads((ROOT / 'config' / 'handover.foxglove.json').read_text(encoding='utf-8'))


def test_rviz_shows_topics_that_exist_in_the_type_of_the_display(rviz: dict[str, Any]) -> None:
    shown = set()
    for display in rviz['Displays']:
        where = display.get('Topic') or display.get('Description Topic')
        if where is None:
            assert display['Class'].rpartition('/')[2] in ('Grid', 'TF')
            continue
        topic = BY_NAME[where['Value']]
        assert topic.type_name == RVIZ_TYPES[display['Class']], topic.name
        shown.add(topic.name)
    assert {'/robot_description', '/handover/markers', '/hand/pose', '/human/pose'} <= shown
    frames = next(d for d in rviz['Displays'] if d['Class'] == 'rviz_default_plugins/TF')
    assert frames['Enabled'] is frames['Value'] is True
    assert rviz['Global Options']['Fixed Frame'] == FRAME


def test_rviz_asks_for_no_more_quality_than_is_offered(rviz: dict[str, Any]) -> None:
    for display in rviz['Displays']:
        where = display.get('Topic') or display.get('Description Topic')
        if where is None:
            continue
        reliability, durability, depth = BY_NAME[where['Value']].quality.value
        # Best effort asks for nothing, volatile neither.
        assert where['Reliability Policy'] in (
            'Best Effort',
            reliability.replace('_', ' ').title(),
        )
        assert where['Durability Policy'] in ('Volatile', durability.replace('_', ' ').title())
        assert where['Depth'] == depth
        if BY_NAME[where['Value']].quality is Quality.LATCHED:
            assert where['Durability Policy'] == 'Transient Local'  # else a late RViz gets nothing


def message_paths(layout: dict[str, Any]) -> Iterator[str]:
    for panel in layout['configById'].values():
        for path in panel.get('paths', ()):
            yield path['value']


def test_foxglove_plots_fields_that_exist(foxglove: dict[str, Any]) -> None:
    paths = list(message_paths(foxglove))
    assert paths
    for path in paths:
        name = next(n for n in BY_NAME if path.startswith(f'{n}.'))
        follow(BY_NAME[name].type_name, path.removeprefix(f'{name}.'))


def follow(type_name: str, fields: str) -> None:
    """Go down the fields of a message; fails where there is none of that name."""
    pytest.importorskip('rclpy')
    package, folder, name = type_name.split('/')
    message = getattr(import_module(f'{package}.{folder}'), name)()
    for field in fields.split('.'):
        field, _, index = field.partition('[')
        message = getattr(message, field)
        assert bool(index) == hasattr(message, '__len__') or isinstance(message, str), fields


def test_the_bag_of_a_run_without_ros_has_what_foxglove_shows(
    foxglove: dict[str, Any], tmp_path: Path
) -> None:
    """A topic that is not in the bag leaves its panel empty, and nobody is told."""
    scenario = make_scenario()
    write_run_bag(tmp_path / 'bag', scenario, simulate(scenario), {})
    has = set(bag_information(tmp_path / 'bag').topics)
    plotted = {path.partition('.')[0] for path in message_paths(foxglove)}
    scene = foxglove['configById']['3D!scene']
    assert plotted <= has
    visible = {name for name, topic in scene['topics'].items() if topic['visible']}
    assert visible - has == {OBJECT_POSE.name}  # of sessions
    assert scene['layers']['arm']['topic'] in has
    last = {topic: message for topic, message, _ in read_bag(tmp_path / 'bag', plotted)}
    for path in message_paths(foxglove):
        name, _, fields = path.partition('.')
        value: Any = last[name]
        for field, index in re.findall(r'(\w+)(?:\[(\d+)\])?', fields):
            value = getattr(value, field)
            value = value[int(index)] if index else value
        assert isinstance(value, float | str), path


def test_legends_of_foxglove_are_beside_the_plots(foxglove: dict[str, Any]) -> None:
    for name, panel in foxglove['configById'].items():
        if name.startswith('Plot!'):
            assert panel['legendDisplay'] == 'left'  # a floating one covers the lines
            assert panel['showLegend']


def test_frames_of_foxglove_are_drawn_large_enough_to_be_seen(foxglove: dict[str, Any]) -> None:
    """Without their meshes, the links of an arm are only seen by their frames."""
    transforms = foxglove['configById']['3D!scene']['scene']['transforms']
    assert LENGTH_OF_AN_AXIS_M * transforms['axisScale'] > 0.08
    assert transforms['enablePreloading']  # else Lichtblick lists an alert


def test_foxglove_plots_three_axes_of_hand_wrist_and_command(foxglove: dict[str, Any]) -> None:
    paths = set(message_paths(foxglove))
    for topic in ('/hand/pose', '/wrist/pose', '/wrist/pose_command', '/human/pose'):
        assert {f'{topic}.pose.position.{axis}' for axis in 'xyz'} <= paths
    assert '/handover/state.data' in paths


def test_foxglove_names_the_numbers_of_the_phase_rightly(foxglove: dict[str, Any]) -> None:
    """`/handover/phase` has its values in the order that the controller gives them."""
    from handover_dmp.handover.controller import HandoverState, WristCommand

    command = WristCommand((0.0,) * 3, (0.0,) * 3, HandoverState.IDLE, 1.0, 0.0, 0.0, 1.0, None)
    names = [name.replace('_', ' ') for name in command.status_values(0.0)]
    for path in foxglove['configById']['Plot!phase']['paths']:
        index = int(re.fullmatch(rf'{PHASE.name}\.data\[(\d+)\]', path['value'])[1])
        assert names[index] == path['label']


def test_foxglove_shows_the_arm_and_the_markers(foxglove: dict[str, Any]) -> None:
    scene = foxglove['configById']['3D!scene']
    for name in scene['topics']:
        assert BY_NAME[name].type_name in SHOWN_IN_3D
    urdf = scene['layers']['arm']
    assert BY_NAME[urdf['topic']].type_name == 'std_msgs/msg/String'
    assert scene['topics']['/handover/markers']['visible']
    assert scene['followTf'] == FRAME
    assert urdf['framePrefix'] == ''
    assert all(scene['topics'][name]['visible'] for name in ('/hand/pose', '/human/pose'))
    summary = foxglove['configById']['DiagnosticSummary!nodes']['topicToRender']
    assert BY_NAME[summary].type_name == 'diagnostic_msgs/msg/DiagnosticArray'


# fmt: off
# What the panels of Lichtblick, the open Foxglove, know of their settings: `RendererConfig` and
# `LayerSettingsCustomUrdf` of its 3D panel, `PlotConfig`, `StateTransitionConfig`, and what its
# summary of `/diagnostics` takes; a title is that of the panel, here and there.
TITLES = {'foxglovePanelTitle', 'lichtblickPanelTitle'}
PANELS = {
    '3D': {
        'cameraState', 'followTf', 'followMode', 'scene', 'publish', 'transforms', 'topics',
        'layers', 'imageMode',
    },
    'Plot': {
        'paths', 'minXValue', 'maxXValue', 'minYValue', 'maxYValue', 'showLegend', 'legendDisplay',
        'showPlotValuesInLegend', 'showXAxisLabels', 'showYAxisLabels', 'isSynced', 'xAxisVal',
        'xAxisPath', 'followingViewWidth', 'sidebarDimension',
    },
    'StateTransitions': {
        'isSynced', 'paths', 'xAxisMaxValue', 'xAxisMinValue', 'xAxisRange', 'showPoints',
    },
    'DiagnosticSummary': {
        'minLevel', 'pinnedIds', 'topicToRender', 'hardwareIdFilter', 'sortByLevel',
        'secondsUntilStale',
    },
}
PATHS = {'value', 'enabled', 'color', 'label', 'timestampMethod', 'showLine', 'lineSize'}
SCENE = {
    'enableStats', 'backgroundColor', 'labelScaleFactor', 'ignoreColladaUpAxis', 'meshUpAxis',
    'transforms', 'syncCamera', 'topicsVisible',
}
FRAMES = {
    'editable', 'showLabel', 'labelSize', 'axisScale', 'lineWidth', 'lineColor', 'enablePreloading'
}
URDF = {
    'visible', 'frameLocked', 'label', 'instanceId', 'layerId', 'order', 'sourceType', 'url',
    'filePath', 'parameter', 'topic', 'framePrefix', 'displayMode', 'fallbackColor',
}
# fmt: on


def test_panels_of_foxglove_have_settings_that_there_are(foxglove: dict[str, Any]) -> None:
    for panel, config in foxglove['configById'].items():
        kind = panel.partition('!')[0]
        assert set(config) <= PANELS[kind] | TITLES, panel
        assert config['foxglovePanelTitle'] == config['lichtblickPanelTitle']
        for path in config.get('paths', []):
            assert set(path) <= PATHS
            assert path['timestampMethod'] in ('receiveTime', 'headerStamp')
    plots = [c for p, c in foxglove['configById'].items() if p.startswith('Plot!')]
    optional = {'minXValue', 'maxXValue', 'minYValue', 'maxYValue', 'xAxisPath'}
    optional.add('followingViewWidth')
    assert all(PANELS['Plot'] - optional <= set(plot) for plot in plots)
    scene = foxglove['configById']['3D!scene']
    assert set(scene['scene']) <= SCENE
    assert set(scene['scene']['transforms']) <= FRAMES
    assert set(scene['layers']['arm']) <= URDF
    assert scene['scene']['meshUpAxis'] in ('y_up', 'z_up')
    assert set(foxglove) == {
        'configById', 'globalVariables', 'userNodes', 'playbackConfig', 'layout'
    }  # fmt: skip


def test_every_panel_of_foxglove_has_a_place(foxglove: dict[str, Any]) -> None:
    def panels(part: Any) -> list[str]:
        return [part] if isinstance(part, str) else panels(part['first']) + panels(part['second'])

    assert sorted(panels(foxglove['layout'])) == sorted(foxglove['configById'])


def test_the_launch_file_starts_rviz_with_this_file() -> None:
    launch = (ROOT / 'launch' / 'handover.launch.py').read_text(encoding='utf-8')
    assert 'config/handover.rviz' in launch
