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
`handover_dmp render`: a video and an animated image of a recorded run, from its bag alone.

With `--figure postures`, it draws Fig. 2 of the paper instead.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from handover_dmp.cli.options import add_json, add_setting, save_json
from handover_dmp.cli.recorded import add_source_and_output
from handover_dmp.cli.robot_arguments import add_robot_arguments, chosen_arm
from handover_dmp.common.errors import UsageError

MAX_JOBS = 4
VIDEOS = ('.mp4',)
IMAGES = ('.webp', '.gif')
FIGURES = ('postures',)
PICTURES = ('.png', '.webp', '.jpg')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of `render`.

    Args:
        parser: parser of the verb.

    """
    add_source_and_output(
        parser,
        'DIR_OR_FILE',
        'folder for handover.mp4 and handover.webp, or a single file to write, .mp4, .webp or '
        '.gif (default: the folder of the run, or <bag>_film); with --figure, the picture',
        optional=True,
    )
    parser.add_argument(
        '--figure',
        choices=FIGURES,
        help='draw a figure instead of a run. postures: Fig. 2 of the paper, with the partner '
        'under the car, at the engine bay and under the lift, each with the arm at the '
        'exchange',
    )
    parser.add_argument(
        '--beside',
        type=Path,
        metavar='RUN',
        help='second run, shown beside the first; each has --size and the name of its folder',
    )
    for name, kind, default in (
        ('--video', 'MP4', 'handover.mp4'),
        ('--image', 'WebP or GIF', 'handover.webp'),
    ):
        purpose = f'{kind} file to write (default: {default} in that folder)'
        parser.add_argument(name, type=Path, metavar='FILE', help=purpose)
    parser.add_argument('--no-video', action='store_true', help='write only the animated image')
    parser.add_argument('--no-image', action='store_true', help='write only the video')
    add_setting(parser, '--size', '960x720', 'WxH', 'width and height of a picture, pixels')
    rate = 'frames per second of the video; the animated image has half as many'
    add_setting(parser, '--rate', 30.0, 'HZ', rate)
    add_setting(parser, '--speed', 1.0, None, 'playback speed; 0.5 is half of real time')
    add_robot_arguments(parser, '')
    parser.add_argument(
        '--jobs',
        type=int,
        metavar='N',
        help='number of processes (default: one per processor, at most 4)',
    )
    add_json(parser, 'write a summary of the outputs as JSON')


def run(options: argparse.Namespace) -> int:
    """
    Film a run.

    Args:
        options: the parsed arguments.

    Returns:
        0.

    Raises:
        DataError: the run does not exist or cannot be drawn.
        UsageError: the options exclude each other.

    """
    import os
    from time import monotonic

    from handover_dmp.cli.progress import progress_bar
    from handover_dmp.view.video import Film, film
    from rich.console import Console

    if options.figure is not None:
        return _draw_figure(options)
    if options.source is None:
        raise UsageError('no run given: name one, or use --figure')
    if options.no_video and options.no_image:
        raise UsageError('--no-video and --no-image together leave nothing to do')
    width, height = _size(options.size)
    how = Film(width, height, options.rate, options.speed, chosen_arm(options), options.namespace)
    video, image = chosen_files(options)
    jobs = options.jobs or min(MAX_JOBS, os.cpu_count() or 1)
    began_s = monotonic()
    with progress_bar() as bar:
        task = bar.add_task('drawing', total=None)
        count = film(
            options.source,
            how,
            beside=options.beside,
            video=video,
            image=image,
            jobs=max(1, jobs),
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    files = [path for path in (video, image) if path is not None]
    made = {
        'pictures': count,
        'length_s': count / options.rate,
        'wall_time_s': monotonic() - began_s,
        'files': {str(path): path.stat().st_size for path in files},
    }
    for path in files:
        Console().print(f'{path}: {path.stat().st_size / 1e6:.2f} MB', soft_wrap=True)
    save_json(made, options.json)
    return 0


def _draw_figure(options: argparse.Namespace) -> int:
    """Draw a figure that needs no run."""
    from handover_dmp.robot.model import RobotModel
    from handover_dmp.view.postures_figure import draw_postures

    if options.source is not None:
        raise UsageError(f'--figure {options.figure} takes no run: leave {options.source} out')
    path = options.output or Path(f'{options.figure}.png')
    if path.suffix.lower() not in PICTURES:
        raise UsageError(f'{path}: the name of a picture must end in {", ".join(PICTURES)}')
    choice = chosen_arm(options)
    arm = RobotModel.load(
        choice.robot or 'lwr4', wrist_frame=choice.wrist_frame, base_frame=choice.base_frame
    )
    draw_postures(arm, path)
    made = {'figure': options.figure, 'output': str(path), 'robot': arm.name}
    save_json(made, options.json)
    print(path)
    return 0


def chosen_files(options: argparse.Namespace) -> tuple[Path | None, Path | None]:
    """
    Tell which video and which image to write.

    Args:
        options: the parsed arguments.

    Returns:
        Paths of video and image; None for one that is not wanted.

    Raises:
        UsageError: `-o` names a single file, and other options ask for more.

    """
    kind = '' if options.output is None else options.output.suffix.lower()
    if kind in (*VIDEOS, *IMAGES) and not options.output.is_dir():
        if options.video or options.image or options.no_video or options.no_image:
            raise UsageError(
                f'-o {options.output} names a single file: leave out the other options for files'
            )
        return (options.output, None) if kind in VIDEOS else (None, options.output)
    folder = options.output or _folder(options.source)
    video = None if options.no_video else options.video or folder / 'handover.mp4'
    image = None if options.no_image else options.image or folder / 'handover.webp'
    return video, image


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition('x')
    if not (width.isdecimal() and height.isdecimal()):
        raise UsageError(f'--size is {text}; expected a size such as 960x720')
    return int(width), int(height)


def _folder(source: Path) -> Path:
    """Return the folder of a run; for a single bag, a folder beside it."""
    if (source / 'bag').is_dir():
        return source
    return source.with_name(f'{source.stem}_film')
