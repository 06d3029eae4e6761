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

"""The report of a run: `report.json` for machines, `report.md` and `index.html` for people."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError
from handover_dmp.common.files import write_text
from handover_dmp.recording import bag_information
from handover_dmp.report.cells import quantity
from handover_dmp.report.figures import CAPTIONS, write_figures
from handover_dmp.report.metrics import FUSED, measure, Numbers
from handover_dmp.report.motion_tables import motion_tables
from handover_dmp.report.motions import compare_motions
from handover_dmp.report.page import as_html, as_markdown, Page, Section, Table
from handover_dmp.report.recorded_run import load_run, RecordedLimits, RunRecord
from handover_dmp.report.session import is_session, session_facts
from handover_dmp.report.session_tables import session_outcome, session_sections

MUCH_NEARER, MUCH_FARTHER = 0.5, 1.5
"""Shares of the learnt distance beyond which the report remarks on it."""
SCENES = {
    'scene_start': 'The scene when the arm begins to move',
    'scene_middle': 'half way',
    'scene_exchange': 'and at the exchange.',
    'scene_end': 'and at the end.',
}
SCENES_OF_SESSIONS = {
    'scene_start': 'Before the reach',
    'scene_give': 'as the object is given',
    'scene_use': 'while it is used',
    'scene_take': 'as it is taken back',
    'scene_end': 'and at the end.',
}


def write_report(
    source: Path | str,
    output: Path | str | None = None,
    namespace: str | None = None,
    *,
    run: RunRecord | None = None,
) -> Numbers:
    """
    Read the bag of a run, measure it, draw it and write its report.

    Args:
        source: the folder of a run, the folder of its bag, or its MCAP file.
        output: folder for `report.json`, `report.md`, `index.html` and `figures/`; by default the
            folder of the run, or `<bag>_report` beside a bag without a run.
        namespace: namespace of the graph, if the bag contains several; None: the only one.
        run: content of the bag, if it has been read already; None: read it.

    Returns:
        The content of `report.json`, in plain types.

    Raises:
        DataError: the bag is missing, damaged or not of a run, or the report cannot be written.

    """
    source = Path(source)
    run = run or load_run(source, namespace)
    folder = Path(output) if output is not None else report_folder(source)
    bag = bag_information(source)
    try:
        figures = write_figures(run, folder / 'figures')
        names = SCENES_OF_SESSIONS if is_session(run) else SCENES
        scenes = [name for name in names if (folder / 'figures' / f'{name}.png').is_file()]
        report: Numbers = _plain(
            {
                **measure(run),
                'motions': compare_motions(run),
                **({'session': session_facts(run)} if is_session(run) else {}),
                'run': run.info,
                'bag': {
                    'source': str(source),
                    'namespace': run.namespace,
                    'files': [file.name for file in bag.files],
                    'size': bag.size,
                    'complete': bag.complete,
                    'messages': bag.message_count,
                    'topics': {
                        name: {'type': topic.type_name, 'messages': topic.count}
                        for name, topic in sorted(bag.topics.items())
                    },
                },
                'figures': figures + scenes,
            }
        )
        page = _page(run, report, figures, scenes)
        write_text(folder / 'report.json', json.dumps(report, indent=2, allow_nan=False) + '\n')
        write_text(folder / 'report.md', as_markdown(page))
        write_text(folder / 'index.html', as_html(page, folder))
    except OSError as error:
        raise DataError(f'{folder}: cannot be written: {error.strerror}') from error
    return report


def report_folder(source: Path) -> Path:
    """Return the default folder of the report of a run or a bag."""
    if (source / 'bag').is_dir():
        return source
    return source.parent / f'{source.stem if source.is_file() else source.name}_report'


def _page(run: RunRecord, report: Numbers, figures: list[str], scenes: list[str]) -> Page:
    about = report['run']
    title = ' '.join(str(about[key]) for key in ('exchange', 'configuration') if key in about)
    outcomes = {True: 'The object changed hands.', False: 'The object did not change hands.'}
    outcome, good = outcomes[run.handed_over], run.handed_over
    captions_of = SCENES
    if 'session' in report:
        facts = report['session']
        outcome, captions_of = session_outcome(facts, good), SCENES_OF_SESSIONS
        good = good and not facts['dropped'] and not facts['released_early']
        sections = session_sections(facts)
        compared = [(f'Robot and people: {leg["direction"]}', leg) for leg in facts['legs']]
    else:
        sections = [Section('In numbers', tables=(_summary(report),))]
        compared = [('Robot and people', report)]
    for heading, measured in compared:
        if measured['motions']['robot'] is not None:
            text = 'From the start of the reach to the exchange, low-passed at 6 Hz.'
            tables = motion_tables(measured['motions'])
            sections.append(Section(heading, text=text, tables=tables))
    if scenes:
        captions = ', '.join(captions_of[name] for name in scenes)
        images = tuple(f'figures/{name}.png' for name in scenes)
        sections.append(Section('Scene', text=captions, images=images))
    drawn = tuple((f'figures/{name}.png', CAPTIONS[name]) for name in figures)
    sections.append(Section('Figures', figures=drawn))
    if report['trackers']:
        sections.append(Section('Trackers', tables=(_trackers(report),)))
    if run.joint_limits is not None:
        table = _joint_limits(run, run.joint_limits)
        judged = _judged(report['limits'])
        sections.append(Section('Joint limits', text=judged, tables=(table,)))
    if about:
        sections.append(Section('Setup', tables=(_about(about),)))
    if about.get('command'):
        sections.append(
            Section('Repeat', text='This command repeats the run:', code=str(about['command']))
        )
    sections.append(Section('Timing', text=_clock(run), tables=_timing(report)))
    sections.append(Section('Recording', text=_bag_text(report), tables=(_bag(report),)))
    what = 'Session' if 'session' in report else 'Handover'
    title = title.removeprefix('session ')
    return Page(f'{what}: {title}' if title else what, outcome, good, tuple(sections))


def _summary(report: Numbers) -> Table:
    lag, demonstrator, limits = report['lag'], report['to_human'], report['limits']
    kinematics = report['inverse_kinematics']
    least = quantity(report['exchange_gap_least_m'], 1e3, 'mm', 1)
    kept = {True: 'kept', False: 'NOT KEPT', None: '–'}
    rows = [
        (
            'gap between wrist and goal when the exchange began',
            quantity(report['exchange_gap_m'], 1e3, 'mm', 1),
            f'minimum during the exchange {least}',
        ),
        (
            'distance of the hand, relative to the demonstration',
            _share(report['hand_distance_share']),
            _nearer_or_farther(report['hand_distance_share']),
        ),
        (
            'largest overshoot of the goal',
            quantity(report['beyond_goal_max_m'], 1e3, 'mm', 1),
            'along the line from the start; negative: the wrist stayed short of the goal',
        ),
        *_carried_rows(report),
        (
            'lag behind the moving hand',
            quantity(lag['time_ms'], 1, 'ms', 1),
            'not measurable: the hand stood still, or the wrist followed it too briefly'
            if lag['time_ms'] is None
            else f'± {lag["error_ms"]:.1f} ms; {lag["distance_mm"]:.2f} mm at '
            f'{lag["hand_speed_m_s"]:.2f} m/s',
        ),
        (
            'lag of the wrist behind its command',
            quantity(report['arm_lag']['time_ms'], 1, 'ms', 1),
            f'{quantity(report["arm_lag"]["rms_mm"], 1, "mm", 2)} RMS, '
            f'{quantity(report["arm_lag"]["largest_mm"], 1, "mm", 2)} maximum',
        ),
        _fact('time from the start of the reach to the exchange', report['reach_duration_s'], 's'),
        _fact('time from the start of the reach to the end', report['handover_duration_s'], 's'),
        (
            'peak speed of the wrist',
            quantity(report['wrist_peak_speed_m_s'], 1, 'm/s', 2),
            _share(
                report['wrist_from_minimum_jerk_share'], 'RMS from the fitted minimum-jerk profile'
            ),
        ),
        _fact('peak speed of the demonstrator', report['human_peak_speed_m_s'], 'm/s'),
        _fact('peak speed of the hand', report['hand_peak_speed_m_s'], 'm/s'),
        (
            'distance to the demonstrator, RMS',
            quantity(demonstrator['rms_m'], 1e3, 'mm', 0),
            f'{quantity(demonstrator["largest_m"], 1e3, "mm", 0)} maximum, '
            f'{quantity(demonstrator["at_exchange_m"], 1e3, "mm", 0)} at the exchange',
        ),
        ('joint limits', kept[limits['met']], _limits_note(limits)),
        (
            'least speed scale of the inverse kinematics',
            _share(kinematics['least_speed_share']),
            _share(kinematics['limited_time_share'], 'of the time a limit was active'),
        ),
        (
            'age of the hand pose when used, median',
            quantity(report['hand_age_median_ms'], 1, 'ms', 1),
            f'99th percentile {quantity(report["hand_age_99_ms"], 1, "ms", 1)}',
        ),
    ]
    return Table((), tuple(rows))


def _carried_rows(report: Numbers) -> list[tuple[str, str, str]]:
    rows = (
        (
            'object_tilt_max_deg',
            f'largest tilt of the {report["object"]}',
            'relative to the start of the run',
        ),
        (
            'handle_angle_deg',
            f'angle between the handle of the {report["object"]} and the hand',
            'when the exchange began',
        ),
    )
    return [
        (name, quantity(report[key], 1, 'deg', 2), remark)
        for key, name, remark in rows
        if report[key] is not None
    ]


def _trackers(report: Numbers) -> Table:
    return Table(
        ('tracker', 'poses', 'rate, Hz', 'error, RMS', 'bias', 'noise, RMS'),
        tuple(
            (
                'all, fused' if name == FUSED else name,
                str(seen['poses']),
                f'{seen["rate_hz"]:.1f}',
                *(quantity(seen[key], 1e3, 'mm', 1) for key in ('rms_m', 'bias_m', 'noise_m')),
            )
            for name, seen in report['trackers'].items()
        ),
    )


def _nearer_or_farther(share: float | None) -> str:
    if share is None or MUCH_NEARER <= share <= MUCH_FARTHER:
        return ''
    return f'much {"nearer" if share < MUCH_NEARER else "farther"} than in the demonstration'


def _limits_note(limits: Numbers) -> str:
    names = [name for name in ('position', 'velocity', 'acceleration') if limits[name] is not None]
    if not names:
        return 'not known'
    parts = [f'{name} {limits[name]["share"]:.0%} ({limits[name]["joint"]})' for name in names]
    return 'maximum use: ' + ', '.join(parts)


def _judged(limits: Numbers) -> str:
    text = f'Limits from the recorded {limits["judged_by"]}.'
    if limits['believed_beyond']:
        text += ' The controller assumed wider limits: ' + '; '.join(limits['believed_beyond'])
    return text


def _joint_limits(run: RunRecord, limits: RecordedLimits) -> Table:
    rows = [
        (
            name,
            _between(limits.lower[i], limits.upper[i]),
            *(_limit(values[i]) for values in (limits.velocity, limits.acceleration)),
        )
        for i, name in enumerate(run.joint_names)
    ]
    if limits.sources:
        quantities = ('position', 'velocity', 'acceleration')
        rows.append(('source', *(limits.sources[name] for name in quantities)))
    return Table(
        ('joint', 'position, rad', 'velocity, rad/s', 'acceleration, rad/s²'), tuple(rows)
    )


def _between(lower: float, upper: float) -> str:
    return f'{lower:.4g} … {upper:.4g}' if math.isfinite(upper - lower) else 'continuous'


def _limit(value: float) -> str:
    return f'{value:.4g}' if math.isfinite(value) and value > 0.0 else 'unknown'


def _about(about: Numbers) -> Table:
    known = {
        'trial': 'trial',
        'trial_source': 'read from',
        'configuration': 'configuration',
        'exchange': 'exchange',
        'number': 'number',
        'learnt_from': 'learnt from',
        'goal_offset_m': 'goal minus hand, m',
        'object': 'object',
        'orientation': 'orientation task',
        'seed': 'seed',
        'scale': 'scale of the motion',
        'robot': 'robot',
        'robot_description': 'robot description',
        'wrist_frame': 'wrist link',
        'base_frame': 'base link',
        'base_position_m': 'base position, m',
        'base_roll_rad': 'base roll, rad',
        'base_pitch_rad': 'base pitch, rad',
        'base_yaw_rad': 'base yaw, rad',
        'machine': 'machine',
    }
    rows = [(label, _text(about[key])) for key, label in known.items() if key in about]
    versions = about.get('versions')
    if isinstance(versions, dict):
        rows.append(('versions', ', '.join(f'{name} {one}' for name, one in versions.items())))
    return Table((), tuple(rows))


def _clock(run: RunRecord) -> str:
    if run.simulated_clock:
        return (
            'The graph ran on simulated time (/clock). The periods below are in simulated time; '
            'the values reported by the nodes are in wall-clock time.'
        )
    return 'The graph ran on the wall clock.'


def _timing(report: Numbers) -> tuple[Table, ...]:
    topics = Table(
        ('topic', 'messages', 'rate, Hz', 'jitter median, ms', 'jitter 99 %, ms', 'longest, ms'),
        tuple(
            (
                name,
                str(topic['count']),
                f'{topic["rate_hz"]:.1f}',
                f'{topic["jitter_median_ms"]:.2f}',
                f'{topic["jitter_99_ms"]:.2f}',
                f'{topic["longest_ms"]:.1f}',
            )
            for name, topic in report['topics'].items()
        ),
    )
    nodes = report['nodes']
    if not nodes:
        return (topics,)
    rows = []
    for name, node in nodes.items():
        values = ', '.join(f'{key} {value}' for key, value in node['values'].items())
        rows.append((name, '; '.join(node['faults']) or 'none', values))
    return topics, Table(('node', 'faults', 'last report'), tuple(rows))


def _bag_text(report: Numbers) -> str:
    bag = report['bag']
    text = f'{bag["messages"]} messages in {", ".join(bag["files"])}, {bag["size"] / 1e6:.2f} MB.'
    if not bag['complete']:
        text += (
            f' The recorder did not close the bag. Repair it: handover_dmp bag repair '
            f'{bag["source"]}'
        )
    return text


def _bag(report: Numbers) -> Table:
    topics = report['bag']['topics']
    rows = [(name, topic['type'], str(topic['messages'])) for name, topic in topics.items()]
    return Table(('topic', 'type', 'messages'), tuple(rows))


def _fact(name: str, value: float | None, unit: str) -> tuple[str, str, str]:
    return name, quantity(value, 1, unit, 2), ''


def _share(value: float | None, what: str = '') -> str:
    return '' if value is None else f'{value:.0%} {what}'.strip()


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get('name', ''))
    if isinstance(value, list):
        return ', '.join(_text(one) for one in value)
    return f'{value:.4g}' if isinstance(value, float) else str(value)


def _plain(value: Any) -> Any:
    """Convert a value to plain JSON types; JSON has no infinities."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
