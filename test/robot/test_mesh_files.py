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

"""A mesh is found wherever ROS or a checked-out repository would have it."""

from __future__ import annotations

from handover_dmp.robot.mesh_files import find_mesh
import pytest

NAME = 'package://some_arm_description/meshes/link_1.stl'


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    monkeypatch.delenv('ROS_PACKAGE_PATH', raising=False)


def write(folder):
    mesh = folder / 'meshes' / 'link_1.stl'
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(b'solid')
    return mesh


def test_in_an_installed_package(tmp_path, monkeypatch):
    mesh = write(tmp_path / 'install' / 'share' / 'some_arm_description')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "empty"}:{tmp_path / "install"}')
    assert find_mesh(NAME, None) == mesh


@pytest.mark.parametrize('root', ['src', 'src/some_arm_description'])
def test_on_the_package_path(tmp_path, monkeypatch, root):
    mesh = write(tmp_path / 'src' / 'some_arm_description')
    monkeypatch.setenv('ROS_PACKAGE_PATH', str(tmp_path / root))
    assert find_mesh(NAME, None) == mesh


def test_beside_the_description_in_its_package(tmp_path):
    package = tmp_path / 'some_arm_description'
    mesh = write(package)
    assert find_mesh(NAME, package / 'urdf' / 'deep') == mesh
    assert find_mesh(NAME, tmp_path) == mesh


def test_in_a_checkout_of_another_name(tmp_path):
    folder = tmp_path / 'some-arm-main'
    mesh = write(folder)
    (folder / 'package.xml').write_text('<package><name>some_arm_description</name></package>')
    assert find_mesh(NAME, folder / 'urdf') == mesh
    (folder / 'package.xml').write_text('<package><name>other</name></package>')
    assert find_mesh(NAME, folder / 'urdf') is None


@pytest.mark.parametrize('name', ['meshes/link_1.stl', '../meshes/link_1.stl'])
def test_relative_to_the_description(tmp_path, name):
    mesh = write(tmp_path)
    (tmp_path / 'urdf').mkdir()
    assert find_mesh(name, tmp_path / 'urdf') == mesh


def test_by_its_full_path(tmp_path):
    folder = tmp_path / 'with a blank'
    mesh = write(folder)
    assert find_mesh(str(mesh), None) == mesh
    assert find_mesh(f'file://{mesh}', None) == mesh


@pytest.mark.parametrize('name', [NAME, 'meshes/link_1.stl', 'https://host/link_1.stl', ''])
def test_what_is_not_there(tmp_path, name):
    assert find_mesh(name, tmp_path) is None
    assert find_mesh(name, None) is None


def test_a_file_that_git_lfs_has_not_fetched_is_not_there(tmp_path):
    mesh = write(tmp_path)
    mesh.write_text('version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n')
    assert find_mesh('meshes/link_1.stl', tmp_path) is None
