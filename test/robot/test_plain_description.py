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

"""What engines read differently is gone from the plain description, and nothing else."""

from __future__ import annotations

from xml.etree import ElementTree

from handover_dmp.common.resources import share_path
from handover_dmp.robot.collision import link_capsules
from handover_dmp.robot.model import RobotModel
from handover_dmp.robot.plain_description import make_plain, parse_xml
from handover_dmp.simulation.self_check import check_models
from handover_dmp.view.drawn_robot import drawn_description
from handover_dmp.view.portrait import draw_portrait
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pinocchio as pin
import pytest

INERTIAL = (
    '<inertial><origin xyz="0.01 0 0.1" rpy="0.3 -0.2 0.1"/><mass value="{mass}"/>'
    '<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial>'
)
POINT_ON_THE_AXIS = INERTIAL.format(mass=1, ixx=0, iyy=0, izz=0).replace('0.01 0 0.1', '0 0 0')
BALL = INERTIAL.format(mass=1.5, ixx=0.01, iyy=0.01, izz=0.01)
JOINT = (
    '<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/>'
    '<origin xyz="0.02 0 0.2"/><axis xyz="{axis}"/>'
    '<limit lower="-2" upper="2" velocity="1" effort="90"/></joint>'
)
AXES = ('0 0 1', '0 1 0', '0 0 2', '0 1 0')
BODIES = ('base', 'l0', 'l1', 'l2', 'l3')


@pytest.fixture
def arm(tmp_path):
    """Write an arm of four joints; a link takes what is given for it, else a ball."""

    def write(more='', head='', **links):
        parts = [f'<link name="{name}">{links.get(name, BALL)}</link>' for name in BODIES]
        parts += [JOINT.format(i=i, parent=BODIES[i], axis=axis) for i, axis in enumerate(AXES)]
        path = tmp_path / 'arm.urdf'
        path.write_text(f'{head}<robot name="some">{"".join(parts)}{more}</robot>')
        return RobotModel.load(path, wrist_frame='l3')

    return write


def agree(model):
    found = check_models(model)
    return found.mass < 1e-8 and found.position_m < 1e-6


def mass_matrix(model):
    upper = np.triu(pin.crba(model.pinocchio_model, model.pinocchio_data, model.home))
    return upper + np.triu(upper, 1).T


def test_an_arm_in_order_is_left_as_it_is(arm):
    model = arm()
    assert model.remarks == ()
    assert agree(model)
    raw = pin.buildModelFromXML(model.urdf_text)
    assert raw.nv == model.dof
    upper = np.triu(pin.crba(raw, raw.createData(), model.home))
    np.testing.assert_allclose(mass_matrix(model), upper + np.triu(upper, 1).T, atol=1e-14)


def test_frames_weigh_nothing(arm):
    plain = arm()
    frames = (
        '<link name="world"/><joint name="w" type="fixed"><parent link="world"/>'
        '<child link="base"/><origin xyz="0 0 0.3" rpy="0 0 0.5"/></joint>'
        '<link name="tool0"/><joint name="t" type="fixed"><parent link="l3"/>'
        '<child link="tool0"/><origin xyz="0 0 0.1"/></joint>'
    )
    model = arm(more=frames)
    assert model.remarks == ()
    assert agree(model)
    np.testing.assert_allclose(mass_matrix(model), mass_matrix(plain), atol=1e-12)


def test_a_moving_link_in_between_may_weigh_nothing(arm):
    model = arm(l1='')
    assert model.remarks == ()
    assert agree(model)


@pytest.mark.parametrize(
    ('links', 'named'),
    [
        ({'l3': ''}, 'l3'),
        ({'l2': '', 'l3': ''}, 'l2, l3'),
        (dict.fromkeys(BODIES, ''), 'l0, l1, l2, l3'),
        (
            {'l3': INERTIAL.format(mass=1, ixx=0, iyy=0, izz=0).replace('0.01 0 0.1', '0 0 0')},
            'l3',
        ),
        ({'l3': INERTIAL.format(mass='heavy', ixx=1, iyy=1, izz=1)}, 'l3'),
    ],
)
def test_links_that_no_engine_could_move_are_named_and_can_be_moved(arm, links, named):
    model = arm(**links)
    assert agree(model)
    assert f'{named}: no moving part has inertia, 1 kg assumed' in model.remarks[-1]
    assert np.linalg.eigvalsh(mass_matrix(model)).min() > 1e-5


def test_inertia_that_no_body_can_have_is_replaced_by_the_nearest_and_said(arm):
    odd = INERTIAL.format(mass=1.5, ixx=0.01, iyy=0.01, izz=0.05)
    model = arm(l2=odd, base=odd)
    assert agree(model)
    assert model.remarks == (
        'l2: physically impossible inertia, replaced by the nearest possible one',
    )
    moments = np.linalg.eigvalsh(model.pinocchio_model.inertias[3].inertia)
    assert moments[2] <= moments[0] + moments[1]


@pytest.mark.parametrize(
    ('odd', 'said'),
    [
        (INERTIAL.format(mass=-2, ixx=1, iyy=1, izz=1), 'l2: a mass of -2 kg, left out'),
        (INERTIAL.format(mass=0, ixx=1, iyy=1, izz=1), 'l2: inertia without mass, left out'),
        (
            INERTIAL.format(mass=1, ixx='nan', iyy=1, izz=1),
            'l2: an <inertial> with values that are not numbers',
        ),
    ],
)
def test_inertia_that_means_nothing_is_left_out_and_said(arm, odd, said):
    model = arm(l2=odd)
    assert agree(model)
    assert len(model.remarks) == 1 and model.remarks[0].startswith(said)


def test_a_thin_disc_is_a_body(arm):
    model = arm(l2=INERTIAL.format(mass=1, ixx=0.01, iyy=0.01, izz=0.02))
    assert model.remarks == ()
    assert agree(model)


@settings(deadline=None, max_examples=25, derandomize=True)
@given(
    points=st.lists(st.tuples(*[st.floats(-0.2, 0.2)] * 3), min_size=4, max_size=8),
)
def test_the_inertia_of_any_body_is_left_as_it_is(points):
    offsets = np.array(points) - np.mean(points, axis=0)
    moments = sum(r @ r * np.eye(3) - np.outer(r, r) for r in offsets)
    values = {
        f'i{"xyz"[i]}{"xyz"[j]}': repr(float(moments[i, j])) for i in range(3) for j in range(i, 3)
    }
    robot = parse_xml(
        '<robot name="r"><link name="a"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/></joint><link name="b"><inertial><mass value="2"/><inertia/></inertial>'
        '</link></robot>'
    )
    robot.find('link/inertial/inertia').attrib.update(values)
    _, remarks = make_plain(robot, None, robot.findall('joint'))
    kept = robot.findall('link')[1].find('inertial/inertia').attrib
    assert remarks == []
    for key, value in values.items():
        assert float(kept[key]) == pytest.approx(float(value), abs=1e-7 * np.trace(moments))


def test_undeclared_prefixes_and_a_late_declaration_are_read_past(arm):
    model = arm(
        more='<sensor:camera name="eye" sensor:rate="30"><link name="not"/></sensor:camera>'
        '<gazebo><plugin filename="x"/></gazebo>',
        head='<!-- a licence -->\n<?xml version="1.0" ?>\n',
    )
    assert model.remarks == ()
    assert agree(model)
    assert 'sensor' not in model.chain_text


@pytest.mark.parametrize('version', ['1.0', '1.2', '2.0'])
def test_a_version_is_no_reason_to_refuse(tmp_path, version):
    path = tmp_path / 'arm.urdf'
    path.write_text(
        share_path('urdf/lwr4.urdf').read_text().replace('<robot ', f'<robot version="{version}" ')
    )
    assert agree(RobotModel.load(path))


def shape(text, kind='collision'):
    return f'{BALL}<{kind}><geometry>{text}</geometry></{kind}>'


def test_a_shape_that_one_engine_does_not_know_costs_the_link_nothing_else(arm):
    """Pinocchio's parser would drop mass and all shapes of such a link without a word."""
    cdf = shape('<cdf filename="a.cdf"/>') + shape('<sphere radius="0.1"/>').removeprefix(BALL)
    model = arm(l2=cdf)
    assert model.remarks == ('l2: a shape <cdf> that the engines do not support, left out',)
    assert agree(model)
    assert [capsule.name for capsule in link_capsules(model)] == ['l2']


def test_a_capsule_becomes_what_both_know(arm):
    capsule = shape('<capsule radius="0.05" length="0.3"/>').replace(
        '<collision>', '<collision><origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>'
    )
    (found,) = link_capsules(arm(l2=capsule))
    ends = sorted([found.start[0], found.end[0]])
    assert found.radius == pytest.approx(0.05)
    assert ends == pytest.approx([-0.05, 0.25])


def test_missing_meshes_are_named_once_and_the_rest_is_kept(arm, tmp_path):
    lost = shape('<mesh filename="package://nowhere/lost.stl"/>')
    model = arm(l1=lost, l2=lost, l3=shape('<box size="0.1 0.1 0.1"/>'))
    assert agree(model)
    assert model.meshes.missing == ('package://nowhere/lost.stl',)
    assert len(model.remarks) == 1
    assert 'l1, l2: 1 of 1 meshes not found, e.g. package://nowhere/lost.stl' in model.remarks[0]
    assert '1 of 4 moving links' in model.remarks[0]
    assert [capsule.name for capsule in link_capsules(model)] == ['l3']


def test_a_mesh_beside_the_file_with_one_number_for_scale(arm, tmp_path):
    faces = ((1, 2, 3), (1, 2, 4), (1, 3, 4), (2, 3, 4))
    corners = ((0, 0, 0), (100, 0, 0), (0, 100, 0), (0, 0, 300))
    lines = ['v {} {} {}'.format(*corner) for corner in corners]
    lines += ['f {} {} {}'.format(*face) for face in faces]
    (tmp_path / 'tetra.obj').write_text('\n'.join(lines))
    model = arm(l2=shape('<mesh filename="tetra.obj" scale="0.001"/>'))
    assert model.remarks == ()
    assert model.meshes.found == ((tmp_path / 'tetra.obj').resolve(),)
    (found,) = link_capsules(model)
    reach = max(np.linalg.norm(found.start), np.linalg.norm(found.end)) + found.radius
    assert 0.25 < reach < 0.45


TETRAHEDRON = 'v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.3\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n'


@pytest.mark.parametrize('kind', ['visual', 'collision'])
@pytest.mark.parametrize(
    ('name', 'data'),
    [
        ('cut.stl', b'\0' * 80 + (500).to_bytes(4, 'little') + b'\1' * 700),
        ('cut.dae', b'<?xml version="1.0"?><COLLADA><library_geometries>'),
        ('empty.obj', b''),
        ('noise.obj', bytes(range(256)) * 9),
        ('new.glb', b'glTF\2\0\0\0'),
        ('nameless', b'v 0 0 0'),
    ],
)
def test_a_mesh_that_cannot_be_read_is_named_once_and_the_arm_drawn(
    arm, tmp_path, name, data, kind
):
    (tmp_path / name).write_bytes(data)
    (tmp_path / 'good.obj').write_text(TETRAHEDRON)
    broken = shape(f'<mesh filename="{name}"/>', kind)
    model = arm(l1=broken, l2=broken, l3=shape('<mesh filename="good.obj"/>', kind))
    assert model.meshes.unreadable == (name,)
    assert model.meshes.found == ((tmp_path / 'good.obj').resolve(),)
    assert model.meshes.missing == ()
    assert len(model.remarks) == 1 and '\n' not in model.remarks[0]
    assert 'l1, l2: 1 of 2 meshes cannot be read' in model.remarks[0]
    assert str(tmp_path / name) in model.remarks[0]
    assert agree(model)
    solid = ['l3'] if kind == 'collision' else []
    assert [capsule.name for capsule in link_capsules(model)] == solid
    pixels = draw_portrait(model)
    assert 0.01 < np.mean(pixels[..., 0] != pixels[0, 0, 0]) < 0.6


@pytest.mark.parametrize('name', ['good.obj', 'GOOD.OBJ', 'good.stl', 'words.stl', 'good.dae'])
def test_a_mesh_that_can_be_read_is_taken(arm, tmp_path, name):
    write_mesh(tmp_path / name)
    both = shape(f'<mesh filename="{name}"/>') + shape(f'<mesh filename="{name}"/>', 'visual')
    model = arm(l2=both.replace(BALL, ''))
    assert model.meshes.found == ((tmp_path / name).resolve(),)
    assert not any('mesh' in remark for remark in model.remarks)
    (found,) = link_capsules(model)
    assert found.radius > 0.02
    assert f'filename="{(tmp_path / name).resolve()}"' in drawn_description(model)


def write_mesh(path):
    """Write a tetrahedron in the format of the name."""
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.3]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    if path.suffix.lower() == '.obj':
        path.write_text(TETRAHEDRON)
    elif path.name == 'words.stl':
        lines = ['solid t']
        for face in corners[faces]:
            rows = [f'vertex {x} {y} {z}' for x, y, z in face]
            lines += ['facet normal 0 0 0', 'outer loop', *rows, 'endloop', 'endfacet']
        path.write_text('\n'.join([*lines, 'endsolid t', '']))
    elif path.suffix == '.stl':
        facets = np.zeros(4, dtype=[('n', '<f4', 3), ('v', '<f4', (3, 3)), ('a', '<u2')])
        facets['v'] = corners[faces]
        path.write_bytes(b'solid by name only'.ljust(80) + b'\4\0\0\0' + facets.tobytes())
    else:
        numbers, indices = (' '.join(map(str, a.ravel())) for a in (corners, faces))
        path.write_text(
            '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
            '<asset><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>'
            f'<source id="p"><float_array id="a" count="12">{numbers}</float_array>'
            '<technique_common><accessor source="#a" count="4" stride="3"><param name="X" '
            'type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>'
            '</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" '
            'source="#p"/></vertices><triangles count="4"><input semantic="VERTEX" source="#v" '
            f'offset="0"/><p>{indices}</p></triangles></mesh></geometry></library_geometries>'
            '<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/>'
            '</node></visual_scene></library_visual_scenes><scene><instance_visual_scene '
            'url="#s"/></scene></COLLADA>'
        )


def test_the_plain_description_is_a_urdf_of_links_joints_and_colours_alone(arm):
    model = arm(more='<transmission/><material name="m"><texture filename="a.png"/></material>')
    tags = {element.tag for element in ElementTree.fromstring(model.chain_text)}
    assert tags == {'link', 'joint'}
