# Copyright 2026 rigid_gns maintainers
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

"""Package metadata, for pip and colcon alike; tool settings are in pyproject.toml."""

from __future__ import annotations

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'rigid_gns_ros'

# What prediction, data, bags and evaluation need: small wheels that exist for every platform.
CORE = [
    'numpy>=1.26',
    'PyYAML>=6.0',
    'h5py>=3.10',
    'scipy>=1.11',
    'safetensors>=0.4',
    'tqdm>=4.66',
    'mcap>=1.2',
    'numba>=0.61',
    'threadpoolctl>=3.1',
    # tiny, pure Python, and part of every ROS 2 (its command line needs it): no extra of its own
    'argcomplete>=3.1',
    'joblib>=1.5',  # processes of this machine and of clusters: `generate`, `experiment`
]
# What a user may want to choose (a CUDA or a CPU torch), cannot have everywhere (pybullet has no
# wheel for Python 3.12, ROS wheels are x86-64 Linux only), or has from apt (ROS).
EXTRAS = {
    'torch': ['torch>=2.6'],
    'teacher': ["pybullet>=3.2.6; python_version < '3.12'"],
    'plot': ['matplotlib>=3.8'],
    'bench': ['mujoco>=3.2'],  # a peer of `rigid-gns benchmark`, which does without it
    'viz': ['rerun-sdk>=0.20'],  # `rigid-gns view`; not in `all`, since it takes 500 MB
    'cluster': ['distributed>=2024.1'],  # --backend dask
    # the meta packages pin Jazzy; a plain `ros-rclpy` would be a newer distribution
    'ros': ['ros-jazzy-rclpy[fastrtps]==7.1.6', 'ros-jazzy-common-interfaces==5.3.6'],
    'test': [
        'pytest>=7.4',
        'pytest-xdist>=3.5',
        'rosbags>=0.10',
        'distributed>=2024.1',
        'mcap-ros2-support>=0.5',
        'playwright>=1.40',  # drives a Chromium that is there already
        'colcon-common-extensions',
        'setuptools>=68,<80',
    ],
    # the site, `make docs`: all MIT or BSD, plain Python; the oldest that were tried together
    'docs': [
        'sphinx>=8.2',
        'myst-parser>=4.0',
        'furo>=2024.8.6',
        'soupsieve<3',  # of furo; later ones need Python 3.11.5, Debian 12 has 3.11.2
    ],
    'dev': ['ruff>=0.9', 'mypy>=1.11', 'types-PyYAML', 'pre-commit>=3.6'],
}
EXTRAS['all'] = sorted({each for name in EXTRAS if name != 'viz' for each in EXTRAS[name]})


def shared_files() -> list[tuple[str, list[str]]]:
    """Return what ROS looks for under share/: (folder, files), sub-folders of config/ kept."""
    share = f'share/{NAME}'
    files = {
        'share/ament_index/resource_index/packages': [f'resource/{NAME}'],
        share: ['package.xml', 'README.md', 'LICENSE'],
        f'{share}/launch': sorted(str(path) for path in Path('launch').glob('*_launch.py')),
    }
    shown = (path for name in ('config', 'rviz', 'foxglove') for path in Path(name).rglob('*'))
    for path in sorted(shown):
        if path.is_file():
            files.setdefault(f'{share}/{path.parent.as_posix()}', []).append(str(path))
    return [(folder, content) for folder, content in files.items() if content]


setup(
    name=NAME,
    version='0.1.0',  # as in package.xml and CHANGELOG.rst, which a test compares
    description='Learned simulators of rigid spheres: real-time prediction in ROS 2',
    long_description=Path('README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    author='rigid_gns maintainers',
    author_email='rigid-gns@example.org',
    maintainer='rigid_gns maintainers',
    maintainer_email='rigid-gns@example.org',
    license='Apache-2.0',
    keywords=['ROS', 'physics', 'simulation', 'graph neural network', 'rigid bodies'],
    classifiers=[
        'Intended Audience :: Science/Research',
        'Programming Language :: Python :: 3.11',
        'Programming Language :: Python :: 3.12',
        'Topic :: Scientific/Engineering :: Physics',
    ],
    python_requires='>=3.11',
    packages=find_packages(include=['rigid_gns_ros*', 'rigid_gns_core*']),
    package_data={
        '': ['py.typed', 'weights/*', 'data/*', 'schemas/*', '*.xml', '*.yaml', '*.json', '*.msg'],
        'rigid_gns_core.show.report': ['static/*', 'static/vendor/*'],
    },
    data_files=shared_files(),
    install_requires=CORE,
    extras_require=EXTRAS,
    zip_safe=False,  # weights and recordings are opened as files
    entry_points={
        'console_scripts': [
            'simulator = rigid_gns_ros.simulator_node:main',
            'tracker = rigid_gns_ros.tracker_node:main',
            'evaluate = rigid_gns_core.commands.cli:evaluate',
            'rigid-gns = rigid_gns_core.commands.cli:main',
        ]
    },
)
