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

"""A recorded handover as a video, and as an animated image for web pages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.common.files import replacing
from handover_dmp.robot.descriptions import ArmChoice
from handover_dmp.view.camera_image import Pixels
from handover_dmp.view.stage import set_up, Stage
import numpy as np
from PIL import Image, ImageDraw, ImageFont

INK = (70, 76, 84)
HOLD_S = 0.8
"""Display time of the last picture before a video repeats, s."""
QUALITY = 8
IMAGE_SUFFIXES = ('.webp', '.gif')


@dataclass(frozen=True)
class Film:
    """
    Options of a video.

    Attributes:
        width: width, pixels.
        height: height, pixels.
        rate_hz: pictures per second, Hz.
        speed: playback speed; 1 is real time, 0.5 half of it.
        arm: the arm; empty fields come from the bag.
        namespace: namespace of the topics, in a bag of several graphs.
        title: title above the picture.

    """

    width: int = 960
    height: int = 720
    rate_hz: float = 30.0
    speed: float = 1.0
    arm: ArmChoice = field(default_factory=ArmChoice)
    namespace: str | None = None
    title: str = ''

    def __post_init__(self) -> None:
        """Refuse options that no encoder supports."""
        if not (64 <= self.width <= 7680 and 64 <= self.height <= 4320):
            raise UsageError(f'a film of {self.width}x{self.height} pixels is no film')
        if self.width % 2 or self.height % 2:
            raise UsageError(f'{self.width}x{self.height}: H.264 needs even numbers of pixels')
        if not (1.0 <= self.rate_hz <= 120.0 and 0.01 <= self.speed <= 100.0):
            raise UsageError(
                f'{self.rate_hz:g} pictures a second at {self.speed:g} times real time is no film'
            )

    def times(self, stage: Stage) -> list[float]:
        """
        List the times to draw.

        Args:
            stage: the recorded handover.

        Returns:
            Recorded times, s, one per picture.

        """
        return [float(time_s) for time_s in stage.frame_times(self.rate_hz / self.speed)]


def film(
    source: Path,
    options: Film,
    *,
    beside: Path | None = None,
    video: Path | None = None,
    image: Path | None = None,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> int:
    """
    Film a recorded handover.

    Args:
        source: folder of a run, folder of its bag, or MCAP file.
        options: options of the video.
        beside: another run to show beside it, from the same moment of its handover on; the titles
            are the names of the folders, and each has the size of `options`.
        video: MP4 file to write; None: none.
        image: animated image to write (WebP or GIF), at half the rate.
        jobs: number of drawing processes.
        progress: called with the number of finished pictures and of all pictures.

    Returns:
        The number of pictures.

    Raises:
        DataError: the run cannot be read, or a file cannot be written.
        UsageError: the encoder is not installed, or the image has another format.

    """
    if image is not None and image.suffix not in IMAGE_SUFFIXES:
        raise UsageError(f'{image}: an animated image ends in {" or ".join(IMAGE_SUFFIXES)}')
    every_other: list[Image.Image] = []
    with ExitStack() as stack:
        sources = [source] if beside is None else [source, beside]
        film_size = len(sources) * options.width, options.height
        write = None
        if video is not None:
            write = stack.enter_context(_video_file(video, options, film_size))
        stages = [
            stack.enter_context(set_up(each, options.arm, options.namespace)) for each in sources
        ]
        each_times = [options.times(stage) for stage in stages]
        count = max(map(len, each_times))
        held = round(HOLD_S * options.rate_hz)
        columns = []
        for each, stage, times in zip(sources, stages, each_times, strict=True):
            titled = options if beside is None else replace(options, title=each.resolve().name)
            moments = times + times[-1:] * (count - len(times))
            if jobs > 1:
                painters = ProcessPoolExecutor(
                    max(1, jobs // len(sources)),
                    get_context('spawn'),
                    _begin_painting,
                    (each, titled),
                )
                stack.callback(painters.shutdown, cancel_futures=True)
                columns.append(painters.map(_paint_one, moments))
            else:
                columns.append(paint(stage, titled, moments))
        pictures = (np.hstack(row) for row in zip(*columns, strict=True))
        progress(0, count)
        for index, picture in enumerate(_with_last_held(pictures, held)):
            if write is not None:
                write(picture)
            if image is not None and index % 2 == 0:
                every_other.append(Image.fromarray(picture))
            progress(min(index + 1, count), count)
    if image is not None:
        save_animation(every_other, image, 2.0 / options.rate_hz)
    return count + held


def paint(stage: Stage, options: Film, times: Iterable[float]) -> Iterator[Pixels]:
    """
    Draw pictures with time and state in a corner.

    Args:
        stage: the recorded handover.
        options: size and speed.
        times: recorded times, s.

    Yields:
        (height, width, 3), red, green and blue.

    """
    begin = stage.record.reaching_time_s or stage.span_s[0]
    size = options.height // 28
    font = ImageFont.load_default(size)
    for time_s in times:
        picture = Image.fromarray(stage.scene.image(time_s, options.width, options.height))
        words = [f'{time_s - begin:.2f} s']
        words += [word for word in (stage.state_at(time_s),) if word]
        words += [f'{options.speed:g} x'] if options.speed != 1.0 else []
        draw = ImageDraw.Draw(picture)
        for column, word in enumerate(words):
            draw.text((size * (1 + 6 * column), options.height - 2 * size), word, INK, font)
        if options.title:
            draw.text((size, size), options.title, INK, font)
        yield np.asarray(picture)


def _with_last_held(pictures: Iterable[Pixels], times: int) -> Iterator[Pixels]:
    picture = None
    for picture in pictures:
        yield picture
    if picture is not None:
        yield from [picture] * times


def save_animation(pictures: Sequence[Image.Image], path: Path, period_s: float) -> None:
    """
    Write an animated image that repeats forever.

    Args:
        pictures: pictures of one size.
        path: WebP or GIF file.
        period_s: time from one picture to the next, s.

    Raises:
        DataError: the file cannot be written.

    """
    kind: dict[str, Any] = {'quality': 92, 'method': 4}
    if path.suffix == '.gif':
        pictures = _with_one_palette(pictures)
        kind = {'optimize': True, 'disposal': 1}
    try:
        with replacing(path) as temporary:
            pictures[0].save(
                temporary,
                save_all=True,
                append_images=pictures[1:],
                duration=round(1000 * period_s),
                loop=0,
                **kind,
            )
    except OSError as error:
        raise DataError(f'{path}: cannot be written: {error}') from error


def _with_one_palette(pictures: Sequence[Image.Image]) -> list[Image.Image]:
    """Reduce all pictures to the same 256 colours, so that static parts do not flicker."""
    row = Image.new('RGB', (pictures[0].width, 3 * pictures[0].height))
    for index, picture in enumerate((pictures[0], pictures[len(pictures) // 2], pictures[-1])):
        row.paste(picture, (0, index * picture.height))
    palette = row.quantize(256, method=Image.Quantize.MEDIANCUT)
    return [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]


@contextmanager
def _video_file(
    path: Path, options: Film, size: tuple[int, int]
) -> Iterator[Callable[[Pixels], None]]:
    """Open an MP4 file that appears when it is complete; yield what adds a picture to it."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise UsageError('videos need the encoder: pip install imageio-ffmpeg') from error
    with ExitStack() as stack:
        try:
            temporary = stack.enter_context(replacing(path))
        except OSError as error:
            raise DataError(f'{path}: cannot be written: {error.strerror}') from error
        encoder = imageio_ffmpeg.write_frames(
            str(temporary),
            size,
            fps=options.rate_hz,
            quality=QUALITY,
            macro_block_size=2,
            ffmpeg_log_level='error',
        )
        # Closed before the file is renamed, because the encoder writes the index at the end.
        stack.callback(encoder.close)
        encoder.send(None)

        def write(picture: Pixels) -> None:
            try:
                encoder.send(np.ascontiguousarray(picture))
            except OSError as error:
                raise DataError(f'{path}: {_last_line(error)}') from error

        yield write


def _last_line(error: OSError) -> str:
    lines = [line for line in str(error).splitlines() if line.strip()]
    return lines[-1].strip() if lines else 'the encoder ended'


_mine: list[tuple[Stage, Film]] = []


def _begin_painting(source: Path, options: Film) -> None:
    """Set the scene up once in a drawing process."""
    import atexit

    stack = ExitStack()
    _mine.append((stack.enter_context(set_up(source, options.arm, options.namespace)), options))
    atexit.register(stack.close)


def _paint_one(time_s: float) -> Pixels:
    ((stage, options),) = _mine
    return next(paint(stage, options, [time_s]))
