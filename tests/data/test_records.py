# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""HDF5 records: the same after a roundtrip, and a damaged file is named, never half-read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from rigid_gns_core.data import records
from rigid_gns_core.data.recipe import DataRecipe, recipe_difference, recipe_hash
from rigid_gns_core.data.records import (
    Dataset,
    DatasetError,
    read_record,
    read_records,
    Record,
    record_path,
    write_recipe,
    write_record,
)
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import rotate_quaternions, Trajectory

RECIPE = DataRecipe(trajectories=3, seed=7, steps=5, teacher={'substeps': 24})


def make_record(index: int = 0, steps: int = 20, count: int = 4) -> Record:
    """Spheres that drift and turn at random."""
    rng = np.random.default_rng(index)
    positions = 50.0 + np.cumsum(rng.normal(size=(steps + 1, count, 3)), axis=0)
    quaternions = rotate_quaternions(
        np.tile([0.0, 0.0, 0.0, 1.0], (steps + 1, count, 1)), rng.normal(size=positions.shape)
    )
    trajectory = Trajectory(
        positions=positions,
        quaternions=quaternions,
        velocities=rng.normal(size=positions.shape),
        angular_velocities=rng.normal(size=positions.shape),
        dt=0.1,
    )
    ramp = Plane((0, 0, 5), (0, 0.6, 0.8), length_x=3.0, friction=0.2)
    scene = Scene(
        surfaces=(*Plane.box(60.0, 40.0), ramp),
        radius=tuple(np.linspace(0.5, 1.0, count)),
        restitution=0.3,
    )
    return Record(
        trajectory=trajectory,
        scene=scene,
        seed=7,
        index=index,
        name=f'{index:04d}',
        teacher={'engine': 'pybullet', 'substeps': 24},
        recipe=recipe_hash(RECIPE),
    )


def fill(folder: Path, indices: tuple[int, ...]) -> None:
    """Write a data set as generation leaves it."""
    folder.mkdir(exist_ok=True)
    write_recipe(folder, RECIPE)
    for index in indices:
        write_record(record_path(folder, index), make_record(index))


def test_a_record_holds_all_that_made_its_trajectory(tmp_path: Path) -> None:
    record = make_record()
    back = read_record(write_record(tmp_path / 'new' / 'a.h5', record))
    assert np.array_equal(back.trajectory.positions, record.trajectory.positions)
    for name in ('quaternions', 'velocities', 'angular_velocities'):
        # float32 on disk: 2^-24 relative, on values below 5
        expected = getattr(record.trajectory, name)
        assert np.abs(getattr(back.trajectory, name) - expected).max() < 3e-7
    assert back.trajectory.dt == record.trajectory.dt
    empty = record.trajectory
    assert replace(back, trajectory=empty) == record
    assert [file.name for file in (tmp_path / 'new').iterdir()] == ['a.h5']


def test_poses_alone_are_smaller_and_give_velocities_by_differences(tmp_path: Path) -> None:
    record = make_record(steps=50, count=30)
    full = write_record(tmp_path / 'full.h5', record)
    poses = write_record(tmp_path / 'poses.h5', record, 'poses')
    assert poses.stat().st_size < 0.6 * full.stat().st_size
    trajectory = read_record(poses).trajectory
    # float32 of values near 100 m: half a step of 7.6e-6
    assert np.abs(trajectory.positions - record.trajectory.positions).max() < 4e-6
    assert np.array_equal(
        trajectory.velocities[1:], np.diff(trajectory.positions, axis=0) / trajectory.dt
    )


def test_many_spheres_of_their_own_size_fit(tmp_path: Path) -> None:
    record = make_record(steps=1, count=10_000)
    assert read_record(write_record(tmp_path / 'many.h5', record)).scene == record.scene


def test_the_units_are_in_the_file(tmp_path: Path) -> None:
    with h5py.File(write_record(tmp_path / 'a.h5', make_record())) as file:
        units = {name: file[name].attrs['unit'] for name in file}
    assert units == {
        'positions': 'm',
        'quaternions': 'x y z w',
        'velocities': 'm/s',
        'angular_velocities': 'rad/s',
    }


@pytest.mark.parametrize('kept', [0.0, 0.01, 0.3, 0.9, 0.9999])
def test_a_truncated_file_is_named(tmp_path: Path, kept: float) -> None:
    path = write_record(tmp_path / 'cut.h5', make_record())
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(DatasetError, match=r'cut.h5: .*damaged.*; generate it again'):
        read_record(path)


@pytest.mark.parametrize('place', [0, 20, 40, 600, 1500, 5000, -4000, -1])
def test_one_changed_byte_is_found(tmp_path: Path, place: int) -> None:
    path = write_record(tmp_path / 'hit.h5', make_record())
    content = bytearray(path.read_bytes())
    content[place] ^= 0x01
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=r'hit.h5: .*damaged'):
        read_record(path)


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'other.h5'
    with pytest.raises(DatasetError, match='no such file'):
        read_record(path)
    with h5py.File(path, 'w') as file:
        file['x'] = 1
    with pytest.raises(DatasetError, match='other.h5: not a trajectory file'):
        read_record(path)


def test_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(records, 'FORMAT_VERSION', 99)
    path = write_record(tmp_path / 'future.h5', make_record())
    monkeypatch.undo()
    with pytest.raises(DatasetError, match='future.h5: format version 99, this program reads 1'):
        read_record(path)


def test_a_diverged_trajectory_is_not_written(tmp_path: Path) -> None:
    record = make_record()
    record.trajectory.positions[3, 0, 0] = np.nan
    with pytest.raises(DatasetError, match='0000: step 3 is not finite'):
        write_record(tmp_path / 'a.h5', record)
    assert not list(tmp_path.iterdir())


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = write_record(tmp_path / 'a.h5', make_record(0))
    broken = make_record(1)
    broken.teacher['engine'] = object()  # not JSON: writing stops half-way
    with pytest.raises(TypeError):
        write_record(path, broken)
    assert read_record(path).index == 0
    assert [file.name for file in tmp_path.iterdir()] == ['a.h5']


def test_a_folder_gives_its_records_in_order(tmp_path: Path) -> None:
    fill(tmp_path, (2, 0, 1))
    data = Dataset(tmp_path)
    assert len(data) == 3 and data.missing == () and data.recipe == RECIPE
    assert [record.index for record in data] == [0, 1, 2]
    assert [record.index for record in read_records(tmp_path)] == [0, 1, 2]
    assert len(read_records(record_path(tmp_path, 1))) == 1


def test_missing_trajectories_are_listed(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match='no data set here'):
        Dataset(tmp_path)
    fill(tmp_path, ())
    with pytest.raises(DatasetError, match='holds no trajectory'):
        Dataset(tmp_path, partial=True)
    fill(tmp_path, (1,))
    with pytest.raises(DatasetError, match='2 of 3 trajectories are missing: 0, 2; run'):
        Dataset(tmp_path)
    data = Dataset(tmp_path, partial=True)
    assert data.missing == (0, 2) and [record.index for record in data] == [1]


def test_a_file_of_another_recipe_or_place_is_named(tmp_path: Path) -> None:
    fill(tmp_path, (0, 1, 2))
    record_path(tmp_path, 1).replace(record_path(tmp_path, 2))
    with pytest.raises(DatasetError, match='0002.h5: holds trajectory 1'):
        list(Dataset(tmp_path, partial=True))
    write_record(record_path(tmp_path, 2), replace(make_record(2), recipe='another'))
    with pytest.raises(DatasetError, match='0002.h5: holds trajectory 2 of recipe another'):
        list(Dataset(tmp_path, partial=True))


def test_a_recipe_differs_in_all_but_the_number_of_trajectories() -> None:
    more = replace(RECIPE, trajectories=30)
    assert recipe_hash(more) == recipe_hash(RECIPE) and not recipe_difference(RECIPE, more)
    changed = replace(RECIPE, friction=0.1, teacher={'substeps': 48})
    assert recipe_hash(changed) != recipe_hash(RECIPE)
    assert recipe_difference(RECIPE, changed) == [
        'friction: 0.5 in the folder, 0.1 now',
        'teacher.substeps: 24 in the folder, 48 now',
    ]


def test_a_damaged_recipe_is_named(tmp_path: Path) -> None:
    fill(tmp_path, (0,))
    (tmp_path / records.RECIPE_NAME).write_text('trajectories: [')
    with pytest.raises(DatasetError, match='recipe.yaml: not valid YAML'):
        Dataset(tmp_path)
