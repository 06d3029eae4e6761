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
A recorded handover as one web page with a time slider, drawn by MeshCat's viewer.

Why MeshCat and not Rerun: its viewer is one script of 0.9 MB that plays a scene from within the
page. The page is therefore a single file, needs no server, network or WebGPU, and can be attached
to a report. Rerun would add 100 MB, a server and usage statistics that are sent by default. Only
MeshCat's messages and viewer are used; its server, which listens on every network interface, is
never started.
"""

from __future__ import annotations

import base64
import html
from importlib.util import find_spec
import json
from pathlib import Path
from typing import Any

from handover_dmp.common.arrays import Array
from handover_dmp.common.errors import DataError, UsageError
from handover_dmp.common.files import write_text
from handover_dmp.view.drawn_robot import drawn_description
from handover_dmp.view.piece import Piece
from handover_dmp.view.scene import (
    FIELD_OF_VIEW_DEG,
    HAND_COLOUR,
    lengths_along,
    tube,
    WRIST_COLOUR,
)
from handover_dmp.view.stage import Stage
import numpy as np
from numpy.typing import NDArray

RATE_HZ = 50.0
MAX_FRAMES = 1500
"""A longer recording gets fewer frames per second, so that the page stays small."""
TRAIL_RADIUS_M = 0.006
FARTHER = 1.1
GRID_M = 0.5
GRID_LINES = 13
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])


def write_page(stage: Stage, path: Path) -> None:
    """
    Write the page.

    Args:
        stage: the recorded handover.
        path: HTML file, self-contained.

    Raises:
        UsageError: MeshCat is not installed.
        DataError: the file cannot be written.

    """
    commands = _Commands()
    drawing = _Drawing(stage, commands)
    drawing.draw()
    try:
        write_text(path, _page(stage, commands, drawing.trails))
    except OSError as error:
        raise DataError(f'{path}: cannot be written: {error.strerror}') from error


class _Commands:
    """Replaces MeshCat's connection to a server, and keeps the messages."""

    def __init__(self) -> None:
        try:
            import meshcat
            import umsgpack
        except ImportError as error:
            raise UsageError('this page needs its viewer: pip install meshcat') from error
        self._pack = umsgpack.packb
        self.packed: list[bytes] = []
        self.root: Any = meshcat.Visualizer(window=self)

    def send(self, command: Any) -> None:
        """Keep a command."""
        self.send_raw(command.lower())

    def send_raw(self, message: dict[str, Any]) -> None:
        """Keep a message."""
        self.packed.append(self._pack(_plain(message)))


def _plain(value: Any) -> Any:
    """Convert NumPy numbers, which MessagePack does not know, to Python numbers."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


class _Drawing:
    """Adds robot, person, object and trails, and their motions, to MeshCat's tree."""

    def __init__(self, stage: Stage, commands: _Commands) -> None:
        from meshcat import animation, geometry

        begin, end = stage.span_s
        self._stage = stage
        self._commands = commands
        self._root = commands.root
        self._geometry = geometry
        self._animation = animation
        rate_hz = min(RATE_HZ, MAX_FRAMES / max(1e-3, end - begin))
        self._times = stage.frame_times(rate_hz)
        self._keys = self._times - self._times[0]
        self._clips: dict[Any, Any] = {}
        self.trails: dict[str, list[int]] = {}

    def draw(self) -> None:
        """Draw and animate everything."""
        self._draw_room()
        self._draw_robot()
        self._draw_person_and_object()
        self._draw_trail('hand', self._stage.scene.hand_path, HAND_COLOUR)
        self._draw_trail('wrist', self._stage.scene.wrist_path, WRIST_COLOUR)
        motion = self._animation.Animation(self._clips)
        self._root.set_animation(motion, play=False, repetitions=1)

    # What stands still

    def _draw_room(self) -> None:
        scene, root = self._stage.scene, self._root
        root['/Background'].set_property('top_color', [0.80, 0.86, 0.92])
        root['/Background'].set_property('bottom_color', [0.97, 0.98, 0.99])
        root['/Axes'].set_property('visible', False)
        camera = scene.camera(1280, 720)
        # The viewer looks at the origin and rotates about it, so the scene is moved there.
        root.set_transform(_pose(-camera.target, NO_TURN))
        root['/Grid'].set_property('visible', False)
        root['floor'].set_object(self._floor(scene.floor_height_m, camera.target))
        for index, (piece, position) in enumerate(scene.pedestal):
            self._draw_piece(f'pedestal/{index}', piece, position)
        for index, (piece, position, turn) in enumerate(scene.around):
            self._draw_piece(f'around/{index}', piece, position, turn)
        for index, (piece, position) in enumerate(scene.table):
            self._draw_piece(f'table/{index}', piece, position)
        away = FARTHER * (camera.eye - camera.target)  # the control bar covers a part of the page
        eye = root['/Cameras/default/rotated/<object>']
        # The viewer's camera has its own axes, y up.
        eye.set_property('position', [away[0], away[2], -away[1]])
        eye.set_property('fov', FIELD_OF_VIEW_DEG)

    def _draw_piece(self, path: str, piece: Piece, position: Array, turn: Array = NO_TURN) -> None:
        """Draw a box or a cylinder at a pose."""
        x, _, z = piece.size
        shape = _cylinder(x / 2, z) if piece.is_round else self._geometry.Box(list(piece.size))
        node = self._root[path]
        node.set_object(shape, self._material(piece.colour))
        node.set_transform(_pose(position, turn))

    def _floor(self, height_m: float, centre: Array) -> Any:
        # Line by line and cell by cell: some browsers skip objects that reach behind the camera.
        ticks = GRID_M * (np.arange(GRID_LINES) - (GRID_LINES - 1) / 2)
        along, across = np.meshgrid(ticks[:-1], ticks)
        flat = np.full(along.size, height_m)
        begin = np.column_stack([along.ravel(), across.ravel(), flat])
        x_lines = np.stack([begin, begin + [GRID_M, 0.0, 0.0]], axis=1).reshape(-1, 3)
        corners = np.vstack([x_lines, x_lines[:, [1, 0, 2]]])
        corners[:, :2] += GRID_M * np.round(centre[:2] / GRID_M)
        return self._geometry.LineSegments(
            self._geometry.PointsGeometry(corners.T.astype(np.float32)),
            self._geometry.LineBasicMaterial(color=0xB4BAC2),
        )

    def _material(self, colour: Any) -> Any:
        red, green, blue = (round(255 * float(part)) for part in colour[:3])
        return self._geometry.MeshPhongMaterial(
            color=(red << 16) + (green << 8) + blue, shininess=20
        )

    # What moves

    def _draw_robot(self) -> None:
        import pinocchio as pin

        robot, scene = self._stage.robot, self._stage.scene
        model = robot.pinocchio_model
        visual = pin.buildGeomFromUrdfString(
            model,
            drawn_description(robot),
            pin.GeometryType.VISUAL,
        )
        data, shapes = model.createData(), visual.createData()
        tracks: dict[str, list[tuple[Array, Array]]] = {g.name: [] for g in visual.geometryObjects}
        for time_s in self._times:
            q = scene.joint_positions(float(time_s))
            pin.updateGeometryPlacements(model, data, visual, shapes, q)
            for shape, place in zip(visual.geometryObjects, shapes.oMg, strict=True):
                turn = pin.Quaternion(place.rotation).coeffs()
                tracks[shape.name].append((place.translation.copy(), turn))
        for shape in visual.geometryObjects:
            node = self._root[f'robot/{shape.name}']
            node.set_object(self._shape(shape), self._material(shape.meshColor))
            self._move(node, tracks[shape.name])

    def _shape(self, shape: Any) -> Any:
        """Return a shape of the robot; MeshCat's own mesh readers lose parts of some files."""
        import coal
        from pinocchio.visualize.meshcat_visualizer import loadPrimitive

        if isinstance(shape.geometry, coal.BVHModelBase):
            return self._geometry.TriangularMeshGeometry(*_mesh(shape.geometry))
        return loadPrimitive(shape)

    def _draw_person_and_object(self) -> None:
        scene = self._stage.scene
        figure = scene.figure
        for index, part in enumerate(figure.parts):
            node = self._root[f'person/{index}']
            node.set_object(self._surface(part), self._material(part.colour))
        for index, piece in enumerate(scene.object_parts):
            self._draw_piece(f'object/{index}', piece, np.array(piece.middle))
        person: list[list[tuple[Array, Array]]] = [[] for _ in figure.parts]
        rod = []
        for time_s in self._times:
            scene.show(float(time_s))
            rod.append(scene.object_pose)
            hand = np.array([np.interp(time_s, scene.times, axis) for axis in scene.hand_path.T])
            posture = figure.posture(hand)
            for part, poses in zip(figure.parts, person, strict=True):
                poses.append(figure.part_pose(part, posture))
        self._move(self._root['object'], rod)
        for index, poses in enumerate(person):
            self._move(self._root[f'person/{index}'], poses)

    def _surface(self, part: Any) -> Any:
        """Join the pieces of a part of the body."""
        import coal
        from scipy.spatial.transform import Rotation

        corners: list[Array] = []
        faces: list[NDArray[np.int64]] = []
        for mesh in part.meshes:
            piece = coal.MeshLoader().load(str(mesh.path), np.array(mesh.scale, dtype=float))
            points, triangles = _mesh(piece)
            faces.append(triangles + sum(map(len, corners)))
            turned = Rotation.from_quat(mesh.orientation).apply(points)
            corners.append(turned + mesh.position)
        return self._geometry.TriangularMeshGeometry(np.vstack(corners), np.vstack(faces))

    def _draw_trail(self, name: str, path: Array, colour: Any) -> None:
        scene = self._stage.scene
        shown = scene.times >= self._times[0]
        surface = tube(path[shown], TRAIL_RADIUS_M)
        if surface is None:
            return
        corners, _, numbers = surface
        triangles = numbers.reshape(-1, 3)
        # Corners are numbered along the path; the triangles must follow the same order.
        triangles = triangles[np.argsort(triangles.min(axis=1), kind='stable')]
        node = self._root[f'{name} trail']
        node.set_object(
            self._geometry.TriangularMeshGeometry(corners, triangles),
            self._material(colour),
        )
        # The page draws more and more of them.
        lengths = lengths_along(path[shown])
        share = np.interp(self._times, scene.times[shown], lengths / max(lengths[-1], 1e-9))
        counts = 3 * np.floor(share * len(triangles))
        self.trails[node.path.lower()] = counts.astype(int).tolist()

    def _move(self, node: Any, poses: list[tuple[Array, Array]]) -> None:
        """Animate a node through poses; a node that never moves is placed once."""
        positions = np.array([position for position, _ in poses])
        turns = np.array([turn for _, turn in poses])
        # q and -q are the same rotation; equal signs avoid turns by the longer way.
        flips = np.cumprod(np.where(np.sum(turns[1:] * turns[:-1], axis=1) < 0.0, -1.0, 1.0))
        turns[1:] *= flips[:, None]
        if np.allclose(positions, positions[0], atol=1e-6) and np.allclose(
            turns, turns[0], atol=1e-6
        ):
            node.set_transform(_pose(positions[0], turns[0]))
            return
        clip = self._animation.AnimationClip(fps=1)
        for name, kind, values in (
            ('position', 'vector3', positions),
            ('quaternion', 'quaternion', turns),
        ):
            track = self._animation.AnimationTrack(name, kind)
            track.frames = self._keys.tolist()
            track.values = np.round(values, 6).tolist()
            clip.tracks[name] = track
        self._clips[node.path] = clip


def _mesh(surface: Any) -> tuple[Array, NDArray[np.int64]]:
    """Return the corners and the triangles of a surface, (n, 3) and (m, 3)."""
    triangles = [surface.tri_indices(index) for index in range(surface.num_tris)]
    return np.array(surface.vertices()), np.array([[t[0], t[1], t[2]] for t in triangles])


def _cylinder(radius: float, length: float) -> Any:
    """Make a cylinder along z; those of three.js are along y."""
    from meshcat.geometry import Cylinder

    class Upright(Cylinder):  # type: ignore[misc]
        def intrinsic_transform(self) -> Array:
            return np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

    return Upright(length, radius)


def _pose(position: Array, turn: Array) -> Array:
    from scipy.spatial.transform import Rotation

    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
    matrix[:3, 3] = position
    return matrix


def _page(stage: Stage, commands: _Commands, trails: dict[str, list[int]]) -> str:
    spec = find_spec('meshcat')
    assert spec is not None, 'it is imported above'
    script = Path(str(spec.origin)).parent / 'viewer' / 'dist' / 'main.min.js'
    begin, end = stage.span_s
    zero = stage.record.reaching_time_s or begin
    told = [
        (max(begin, time_s) - begin, name) for time_s, name in stage.record.states if time_s <= end
    ]
    info = stage.record.info
    title = ' '.join(str(info[key]) for key in ('trial', 'robot') if info.get(key)) or 'handover'
    return PAGE.format(
        title=html.escape(title),
        script=script.read_text(encoding='utf-8').replace('</script', '<\\/script'),
        commands=json.dumps([base64.b64encode(one).decode() for one in commands.packed]),
        states=json.dumps(told).replace('<', '\\u003c'),
        trails=json.dumps(trails),
        length=f'{end - begin:.3f}',
        zero=f'{zero - begin:.3f}',
    )


PAGE = """<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>
body {{ margin: 0; font: 15px/1.4 system-ui, sans-serif; color: #3a4048; }}
#pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#bar {{ position: fixed; left: 0; right: 0; bottom: 0; display: flex; gap: 14px;
  align-items: center; padding: 12px 20px; background: #fffffff0; border-top: 1px solid #d8dce0; }}
#bar button {{ width: 6em; padding: 4px; font: inherit; }}
#time {{ flex: 1; }}
#now {{ width: 5em; text-align: right; font-variant-numeric: tabular-nums; }}
#state {{ width: 6em; }}
#title {{ position: fixed; top: 12px; left: 20px; }}
.key {{ white-space: nowrap; }}
.key::before {{ content: ''; display: inline-block; width: 18px; height: 4px; margin-right: 6px;
  vertical-align: middle; background: var(--colour); }}
</style>
<div id="pane"></div>
<div id="title">{title}</div>
<div id="bar">
<button id="play">Play</button>
<input id="time" type="range" min="0" max="{length}" step="0.005" value="0" aria-label="time">
<span id="now"></span><span id="state"></span>
<span class="key" style="--colour:#ff292e">partner's hand</span>
<span class="key" style="--colour:#1f7aff">robot's wrist</span>
</div>
<script>{script}</script>
<script>
const commands = {commands};
const states = {states};
const trails = {trails};
const viewer = new MeshCat.Viewer(document.getElementById('pane'));
for (const text of commands)
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
const slider = document.getElementById('time');
const button = document.getElementById('play');
const length = {length}, zero = {zero};
let since = null;
viewer.animator.play();
viewer.animator.pause();
function show(time) {{
  slider.value = time;
  viewer.animator.seek(time);
  viewer.animator.display_progress(time);
  for (const [path, counts] of Object.entries(trails)) {{
    const node = viewer.scene_tree.find([...path.split('/').filter(Boolean), '<object>']);
    const frame = Math.round(time / length * (counts.length - 1));
    node.object.geometry.setDrawRange(0, counts[frame]);
  }}
  document.getElementById('now').textContent = (time - zero).toFixed(2) + ' s';
  const passed = states.filter(([begin]) => begin <= time + 1e-9);
  document.getElementById('state').textContent = passed.length ? passed.at(-1)[1] : '';
}}
function stop() {{
  since = null;
  button.textContent = 'Play';
}}
function play() {{
  const from = slider.value >= length ? 0 : Number(slider.value);
  since = performance.now() - 1000 * from;
  button.textContent = 'Pause';
  requestAnimationFrame(step);
}}
function step(now) {{
  if (since === null) return;
  const time = Math.min(length, Math.max(0, (now - since) / 1000));
  show(time);
  if (time >= length) stop(); else requestAnimationFrame(step);
}}
slider.oninput = () => {{ stop(); show(Number(slider.value)); }};
button.onclick = () => since === null ? play() : stop();
const asked = location.hash.match(/^#t=([0-9.]+)$/);
show(asked ? Math.min(length, Number(asked[1])) : 0);
if (!asked) play();
</script>
</html>
"""
