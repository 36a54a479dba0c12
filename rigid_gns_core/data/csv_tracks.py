# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks in CSV: `track,sphere,time,x,y,z[,qx,qy,qz,qw]`, with a header.

Other columns are ignored. A row is one measurement of one sphere. Rows of one track with the same
time are one frame; a sphere without a row in it was not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .tracks import sorted_labels, Track
from ..errors import shown, UserError
from ..scenes.state import Array

_TEXT, _NUMBERS, _ROTATION = ('track', 'sphere'), ('time', 'x', 'y', 'z'), ('qx', 'qy', 'qz', 'qw')
# two quaternions within this of norm 1 are taken as written with few digits
_NORM = 0.1
# a smaller one is of no rotation
_LEAST = 1e-6
# no larger number is a measurement: nanoseconds since 1970 are 2e18
_LARGEST = 1e19
# longest name of a track or a sphere [characters]
_LONGEST = 200


class CsvError(UserError):
    """A CSV file cannot be read as tracks; the message names file and line."""


@dataclass(frozen=True)
class CsvTrack:
    """A track, and the lines of its file.

    Args:
        track: The track.
        file: Its file.
        lines: Line of each measurement, from 1, 0 where a sphere was not seen, shape (m, n).
    """

    track: Track
    file: Path
    lines: NDArray[np.int64]


def read_csv_tracks(path: str | Path) -> list[CsvTrack]:
    """Tracks of one file, in the order of their first rows.

    Names are those in the file. Times are since the first frame of each track.

    Raises:
        CsvError: The header lacks a column, a value is no finite number, time does not rise from
            row to row of a sphere, or there are no rows.
    """
    path = Path(path)
    names, values, lines, turned = _read(path)
    if not len(lines):
        raise CsvError(f'{path}: holds no rows after its header; record a track')
    order: dict[str, list[int]] = {}
    for row, (track, _) in enumerate(names):
        order.setdefault(track, []).append(row)
    found = []
    for track, chosen in order.items():
        rows = np.array(chosen)
        spheres = [names[row][1] for row in chosen]
        found.append(_assemble(path, track, spheres, values[rows], lines[rows], turned))
    return found


def _read(path: Path) -> tuple[list[tuple[str, str]], Array, NDArray[np.int64], bool]:
    """Track and sphere of each row, its numbers and line, and whether rotations are given."""
    try:
        with open(path, newline='', encoding='utf-8-sig') as stream:
            reader = csv.reader(stream)
            header = [cell.strip() for cell in next(filter(_has_value, reader), [])]
            columns, turned = _columns(path, header)
            names, numbers, lines = [], [], []
            for row in reader:
                if not _has_value(row):
                    continue
                if len(row) < len(header):
                    raise CsvError(
                        f'{path} line {reader.line_num}: {len(row)} cells, expected '
                        f'{len(header)} as in the header; complete or remove the line'
                    )
                name = row[columns[0]].strip(), row[columns[1]].strip()
                if bad := [text for text in name if not _is_name(text)]:
                    raise CsvError(
                        f'{path} line {reader.line_num}: track or sphere is {shown(bad[0])}, '
                        f'expected a name of 1 to {_LONGEST} characters without NUL'
                    )
                names.append(name)
                numbers.append([row[column] for column in columns[2:]])
                lines.append(reader.line_num)
    except (UnicodeDecodeError, csv.Error) as error:
        raise CsvError(
            f'{path}: not a CSV file in UTF-8: {error}; save it as CSV with the encoding UTF-8'
        ) from error
    return names, _numbers(path, header, columns, numbers, names, lines), np.array(lines), turned


def _has_value(row: Sequence[str]) -> bool:
    return any(cell.strip() for cell in row)


def _is_name(text: str) -> bool:
    return 1 <= len(text) <= _LONGEST and '\0' not in text


def _columns(path: Path, header: Sequence[str]) -> tuple[list[int], bool]:
    """Places of the known columns, and whether rotations are among them."""
    needed = (*_TEXT, *_NUMBERS)
    given = [name for name in _ROTATION if name in header]
    if given and len(given) < 4:
        raise CsvError(
            f'{path}: the header has {", ".join(given)} of a quaternion; expected all of '
            f'{", ".join(_ROTATION)}, or none'
        )
    for name in needed:
        if header.count(name) != 1:
            raise CsvError(
                f'{path}: the header has {header.count(name)} columns {name!r}, expected one; '
                f'columns are {", ".join(header)[:200] or "none"}; begin the file with '
                f'{",".join(needed)}[,{",".join(_ROTATION)}], divided by commas'
            )
    return [header.index(name) for name in (*needed, *given)], bool(given)


def _numbers(
    path: Path,
    header: Sequence[str],
    columns: Sequence[int],
    cells: Sequence[Sequence[str]],
    names: Sequence[tuple[str, str]],
    lines: Sequence[int],
) -> Array:
    """Numbers of all rows, shape (rows, 4 or 8)."""
    try:
        values = np.array(cells, dtype=np.float64).reshape(len(cells), len(columns) - 2)
    except ValueError:
        values = np.array([[_number(cell) for cell in row] for row in cells])
    usable = np.abs(values) < _LARGEST
    for row, place in np.argwhere(np.isnan(values[:, 4:])) + (0, 4):  # unknown rotations
        usable[row, place] = cells[row][place].strip().lower() in ('', 'nan')
    bad = np.argwhere(~usable)
    if len(bad):
        row, place = (int(index) for index in bad[0])
        track, sphere = names[row]
        rows = len(np.unique(bad[:, 0]))
        more = f' (and {rows - 1} more rows)' if rows > 1 else ''
        cell = cells[row][place].strip()
        value = shown(cell) if cell else 'empty'
        raise CsvError(
            f'{path} line {lines[row]}: track {track}, sphere {sphere}: '
            f'{header[columns[place + 2]]} is {value}{more}, '
            'expected a number under 1e19; leave out the rows in which a sphere is not seen'
        )
    return values


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float('nan')


def _assemble(
    path: Path,
    name: str,
    spheres: Sequence[str],
    values: Array,
    lines: NDArray[np.int64],
    turned: bool,
) -> CsvTrack:
    labels = sorted_labels(spheres)
    place = {label: index for index, label in enumerate(labels)}
    columns = np.array([place[sphere] for sphere in spheres])
    # differences first: a clock since 1970 leaves 0.2 microseconds in a float64
    begin = float(values[:, 0].min())
    since = values[:, 0] - begin
    for column, label in enumerate(labels):
        own = np.flatnonzero(columns == column)
        back = np.flatnonzero(np.diff(since[own]) <= 0)
        if len(back):
            before, after = values[own[back[0]], 0], values[own[back[0] + 1], 0]
            where = f'{path} line {lines[own[back[0] + 1]]}: track {name}, sphere {label}'
            if since[own[back[0]]] == since[own[back[0] + 1]]:
                raise CsvError(
                    f'{where}: a second row at {after:.9g} s, expected one row per sphere and '
                    'time; give two balls two numbers, or remove the row'
                )
            raise CsvError(
                f'{where}: time goes back from {before:.9g} to {after:.9g} s, expected rising '
                'times; sort the rows, or begin a new track where the clock restarts'
            )
    times, frames = np.unique(since, return_inverse=True)
    shape = len(times), len(labels)
    positions, where_from = np.full((*shape, 3), np.nan), np.zeros(shape, dtype=np.int64)
    positions[frames, columns] = values[:, 1:4]
    where_from[frames, columns] = lines
    quaternions = None
    if turned:
        norm = np.linalg.norm(values[:, 4:], axis=1, keepdims=True)
        norm[norm < _LEAST] = np.nan  # a rotation that is NaN or zero is unknown
        off = np.flatnonzero(np.abs(norm[:, 0] - 1.0) > _NORM)
        if len(off):
            raise CsvError(
                f'{path} line {lines[off[0]]}: track {name}, sphere {spheres[off[0]]}: the '
                f'quaternion has norm {norm[off[0], 0]:.3g}, expected 1 within {_NORM:g}; leave '
                'it empty where a rotation is unknown, or leave out the columns qx, qy, qz, qw'
            )
        quaternions = np.full((*shape, 4), np.nan)
        quaternions[frames, columns] = values[:, 4:] / norm
    track = Track(name, times, positions, quaternions, labels, begin)
    return CsvTrack(track, path, where_from)
