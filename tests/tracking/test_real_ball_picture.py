# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""The picture of a tracked ball, from tracks in closed form."""

import importlib.util
from pathlib import Path

from csv_balls import rows_of, shots, write_csv, write_scene
import pytest
from rigid_gns_core.commands.cli import main as rigid_gns

SCRIPT = Path(__file__).parents[2] / 'benchmarks' / 'tracking' / 'real_ball.py'


def test_the_error_of_the_right_laws_is_the_noise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = importlib.util.spec_from_file_location('real_ball', SCRIPT)
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    scene, data = write_scene(tmp_path), tmp_path / 'data'
    tracks = write_csv(tmp_path / 'shots.csv', rows_of(shots(noise=0.5e-3)))
    assert rigid_gns(['import', str(tracks), '--scene', str(scene), '--out', str(data)]) == 0
    capsys.readouterr()
    picture = tmp_path / 'ball.png'
    arguments = ['--data', str(data), '--scene', str(scene), '--track', 'shots_0']
    assert script.main([*arguments, '--last', '0.3', '--out', str(picture)]) == 0
    assert picture.read_bytes().startswith(b'\x89PNG')
    errors = [line for line in capsys.readouterr().out.splitlines() if '0.3:' in line]
    assert len(errors) == 2
    # 0.5 mm of noise over 0.2 s is 2 mm/s of velocity: a millimetre after 0.3 s, in centimetres
    assert all(float(line.split('0.3:')[1].strip(' }')) < 0.5 for line in errors)
