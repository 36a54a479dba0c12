# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What may be imported where: the core without ROS, Bullet and plots, and lightly."""

from __future__ import annotations

import ast
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ('rigid_gns_core', 'rigid_gns_ros')

# What a machine without them looks like: every import of these, or of their parts, fails.
BLOCK = """
import sys

class Absent:
    names = {names}

    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in self.names:
            raise ModuleNotFoundError(f'No module named {{name!r}} (blocked by a test)', name=name)

sys.meta_path.insert(0, Absent())
"""
ABSENT = (
    'rclpy',
    'geometry_msgs',
    'std_msgs',
    'ament_index_python',
    'pybullet',
    'pybullet_data',
    'torch',
    'matplotlib',
)


def run(code: str, absent: tuple[str, ...] = ()) -> str:
    """Return standard output of a fresh interpreter; fail with its traceback."""
    code = BLOCK.format(names=set(absent) or '()') + code
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_core_import_is_light() -> None:
    output = run("""
import rigid_gns_core
print(sorted(rigid_gns_core.__all__) == sorted(dir(rigid_gns_core)))
print({'torch', 'pybullet', 'matplotlib', 'rclpy'} & set(sys.modules))
""")
    assert output.split('\n')[:2] == ['True', 'set()']


def test_a_command_can_be_interrupted_before_anything_heavy_is_loaded() -> None:
    """What is imported before `main` has its handlers ends with a traceback by Ctrl-C."""
    output = run("""
import rigid_gns_core.commands.cli
print({'numpy', 'yaml', 'numba'} & set(sys.modules))
""")
    assert output == 'set()\n'


def test_public_names_exist() -> None:
    import rigid_gns_core

    for name in rigid_gns_core.__all__:
        assert getattr(rigid_gns_core, name) is not None
    with pytest.raises(AttributeError, match='no attribute'):
        _ = rigid_gns_core.no_such_name


def test_rollout_without_torch_ros_bullet_and_plots() -> None:
    output = run(
        """
import numpy as np
from rigid_gns_core import Plane, Scene, load_simulator

scene = Scene(surfaces=Plane.box(20.0, 20.0))
positions = np.array([[0.0, 0.0, 3.0], [0.4, 0.0, 6.0], [5.0, 5.0, 1.0]])
trajectory = load_simulator().rollout(scene, positions, steps=10)
assert trajectory.diverged_at is None
print(trajectory.positions.shape, set(Absent.names) & set(sys.modules))
""",
        ABSENT,
    )
    assert output.strip() == '(11, 3, 3) set()'


def test_the_network_of_the_thesis_asks_for_torch() -> None:
    output = run(
        """
from rigid_gns_core import load_simulator
try:
    load_simulator('gns')
except ModuleNotFoundError as error:
    print(error)
""",
        ABSENT,
    )
    assert output.startswith("model 'gns' needs torch, which is not installed")
    assert "pip install 'torch>=2.6'" in output


def test_the_laws_ask_for_numba() -> None:
    output = run(
        """
from rigid_gns_core import load_simulator, Scene
try:
    load_simulator().rollout(Scene(), [[0.0, 0.0, 2.0]], steps=1)
except ModuleNotFoundError as error:
    print(error)
""",
        ('numba',),
    )
    assert output == 'the engine needs numba, which is not installed: pip install numba\n'


def test_bags_are_read_without_ros() -> None:
    run(
        'import rigid_gns_core.messages.poses, rigid_gns_core.bags.writer\n'
        'import rigid_gns_core.recordings.scoring.evaluate',
        ABSENT,
    )


def modules() -> list[Path]:
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob('*.py'))


def imported(path: Path) -> set[str]:
    """Top-level names that a module imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            names.add(node.module.split('.')[0])
    return names


def test_only_the_teacher_imports_pybullet() -> None:
    users = [path.name for path in modules() if 'pybullet' in imported(path)]
    assert users == ['bullet.py']


def test_core_knows_nothing_of_ros() -> None:
    ros = {'rclpy', 'rigid_gns_ros', 'geometry_msgs', 'std_msgs', 'std_srvs', 'ament_index_python'}
    for path in (ROOT / 'rigid_gns_core').rglob('*.py'):
        # evaluate hands a bag over to rigid_gns_ros, which needs no ROS for it
        allowed = {'rigid_gns_ros'} if path.name == 'evaluate.py' else set()
        assert not imported(path) & (ros - allowed), path.name


@pytest.mark.parametrize('path', modules(), ids=lambda path: f'{path.parent.name}/{path.stem}')
def test_pickle_is_never_loaded(path: Path) -> None:
    text = path.read_text(encoding='utf-8')
    assert 'torch.load(' not in text
    assert 'allow_pickle=True' not in text
    # but for machine code in the user's own folders, which Numba pickles in its own cache too
    assert ('pickle' in imported(path)) == (path.name == 'machine_code.py')
