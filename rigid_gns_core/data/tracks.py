# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks as a tracker gave them: stamped positions, not resampled; see docs/data_format.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checked_hdf5 import DatasetError, read_checked, storable, write_checked
from ..errors import UserError
from ..files.strict_json import parse_json
from ..scenes.scene import Scene
from ..scenes.state import Array, rotation_between

TRACKS_NAME = 'tracks.h5'

_KIND, _VERSION, _REMEDY = 'tracks', 1, 'import it again'
# a sphere that never turns by more has an unknown rotation [rad]
_UNTURNED = 1e-9
_UNITS = {'times': 's', 'positions': 'm', 'quaternions': 'x y z w'}


@dataclass(frozen=True)
class Track:
    """One recording of some spheres, without a cut.

    Args:
        name: Name, one of its kind in a data set.
        times: Times of the frames since the first [s], rising, shape (m,).
        positions: Centres [m], shape (m, n, 3), NaN where a sphere was not seen.
        quaternions: Rotations (x, y, z, w), shape (m, n, 4), NaN where not seen or unknown; None:
            rotations were not tracked.
        spheres: Label of each sphere, n of them.
        begin: Time of the first frame on the tracker's clock [s].

    Raises:
        UserError: Shapes disagree, times do not rise, or a position is neither finite nor NaN in
            all three coordinates.
    """

    name: str
    times: Array
    positions: Array
    quaternions: Array | None
    spheres: tuple[str, ...]
    begin: float = 0.0

    def __post_init__(self) -> None:
        m, n = len(self.times), len(self.spheres)
        shapes = {'times': (m,), 'positions': (m, n, 3), 'quaternions': (m, n, 4)}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is None and name == 'quaternions':
                continue
            array = np.asarray(value, dtype=np.float64)
            if array.shape != shape:
                raise UserError(
                    f'track {self.name}: {name} have shape {array.shape}, expected {shape}'
                )
            if (
                name != 'times'
                and (np.isfinite(array).any(-1) != np.isfinite(array).all(-1)).any()
            ):
                raise UserError(
                    f'track {self.name}: {name} are finite in part; expected all coordinates of '
                    'a sphere, or NaN in all where it was not seen'
                )
            object.__setattr__(self, name, array)
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0).all()):
            raise UserError(f'track {self.name}: times do not rise; sort its frames')

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether a sphere was seen in a frame, shape (m, n)."""
        return np.asarray(np.isfinite(self.positions).all(axis=-1))

    def samples(self, sphere: int) -> tuple[Array, Array]:
        """Times [s], shape (k,), and centres [m], shape (k, 3), where the n-th sphere was seen."""
        seen = self.seen[:, sphere]
        return self.times[seen], self.positions[seen, sphere]


def known_rotations(quaternions: Array) -> Array | None:
    """Rotations of the spheres that turn; NaN for those that never do, None where none does.

    Trackers of positions send one rotation throughout. That of a sphere that rolls is then not
    known, and it would be wrong to take it for one that slides without spin.

    Args:
        quaternions: Rotations (x, y, z, w), shape (m, n, 4), NaN where not seen.
    """
    found = np.array(quaternions, dtype=np.float64)
    for own in np.moveaxis(found, 1, 0):
        seen = own[np.isfinite(own).all(axis=-1)]
        if np.abs(rotation_between(seen[:1], seen)).max(initial=0.0) <= _UNTURNED:
            own[:] = np.nan
    return found if np.isfinite(found).any() else None


@dataclass(frozen=True)
class TrackSet:
    """The tracks of a data set.

    Args:
        tracks: Tracks, in the order of their files.
        scene: Surfaces, spheres and gravity that they were imported with.
        noise: Standard deviation of each coordinate of a position [m], estimated.
        origin: Where they come from: files, units, clock; of types that JSON knows.
    """

    tracks: tuple[Track, ...]
    scene: Scene
    noise: float
    origin: dict[str, Any] = field(default_factory=dict)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of all spheres, numbers first; properties per sphere of a scene go by them."""
        return sorted_labels(label for track in self.tracks for label in track.spheres)


def sorted_labels(labels: Iterable[str]) -> tuple[str, ...]:
    """Each label once, whole numbers first and by their value."""
    return tuple(
        sorted(set(labels), key=lambda one: (0, int(one), '') if one.isdecimal() else (1, 0, one))
    )


def tracks_hash(tracks: Sequence[Track]) -> str:
    """SHA-256 of times, labels and poses: the same for the same tracks, wherever they lie."""
    digest = hashlib.sha256()
    for track in tracks:
        digest.update(json.dumps([track.name, track.spheres]).encode())
        for name in _UNITS:
            if (value := getattr(track, name)) is not None:
                digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()


def write_tracks(folder: str | Path, found: TrackSet) -> Path:
    """Write the tracks of a data set to its folder, whole or not at all."""
    path = Path(folder) / TRACKS_NAME
    with write_checked(path, _KIND) as file:
        file.attrs['format_version'] = _VERSION
        file.attrs['scene'] = json.dumps(found.scene.to_mapping())
        file.attrs['noise'] = found.noise
        file.attrs['origin'] = json.dumps(found.origin)
        for index, track in enumerate(found.tracks):
            group = file.create_group(f'{index:04d}')
            group.attrs['name'], group.attrs['begin'] = storable(track.name), track.begin
            group.attrs['spheres'] = json.dumps(track.spheres)
            for name, unit in _UNITS.items():
                if (value := getattr(track, name)) is not None:
                    stored = group.create_dataset(
                        name, data=value, dtype='f8', compression='gzip', shuffle=True
                    )
                    stored.attrs['unit'] = unit
            file.flush()  # in this order: left to HDF5 it depends on when objects are freed
    return path


def read_tracks(data: str | Path) -> TrackSet:
    """Tracks, scene and noise of a data set: its folder, or the file of its tracks.

    Raises:
        DatasetError: There are no tracks, or the file is damaged or of another version.
    """
    path = Path(data)
    path = path / TRACKS_NAME if path.is_dir() else path
    if not path.is_file():
        raise DatasetError(
            f'{data}: holds no tracks, {TRACKS_NAME} is absent; make it by `rigid-gns import`'
        )
    with read_checked(path, _KIND, _VERSION, _REMEDY) as file:
        tracks = tuple(
            Track(
                name=str(group.attrs['name']),
                spheres=tuple(parse_json(group.attrs['spheres'])),
                begin=float(group.attrs['begin']),
                times=np.asarray(group['times']),
                positions=np.asarray(group['positions']),
                quaternions=np.asarray(group['quaternions']) if 'quaternions' in group else None,
            )
            for group in (file[key] for key in sorted(file, key=int))
        )
        return TrackSet(
            tracks=tracks,
            scene=Scene.from_mapping(parse_json(file.attrs['scene'])),
            noise=float(file.attrs['noise']),
            origin=parse_json(file.attrs['origin']),
        )


def load_tracks(data: str | Path) -> list[Track]:
    """Tracks of a data set, see `read_tracks`."""
    return list(read_tracks(data).tracks)
