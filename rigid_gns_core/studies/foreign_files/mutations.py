# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Changes of bytes and of texts, as damage, other programs and slips of the hand make them."""

from __future__ import annotations

from collections.abc import Callable
import re

import numpy as np

_MOST = 4  # changes of one file
# numbers at which lengths, counts and signs go wrong
_EDGES = (0, 1, 2, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63, -1)
# what stands where a number is expected
_WORDS = (
    *('nan', 'inf', '-inf', '.nan', '.inf', '-.inf', '1e400', '1e308', '1.0e+308', '-0', '0'),
    *('-1', '1e-320', '9' * 30, '9' * 400, '0x7f', '1_000', '1:30:00', '2020-99-01', '1e19'),
    *('true', 'null', '~', '', '""', "'", '"', '[]', '{}', '[1, 2]', '{a: 1}', 'x', 'é', '\0'),
    *(
        '\ufeff',
        '\u2028',
        '٣',
        '１',
        '!!python/object:os.system {}',
        '&a 1',
        '*a',
        '- ',
        ': ',
        '#',
    ),
)
# a list of lists of one list: nine names, 10^9 items where they are written out
_BOMB = '{' + ', '.join(
    ['a0: &a0 [x, x, x, x, x, x, x, x, x, x]']
    + [f'a{k}: &a{k} [{", ".join([f"*a{k - 1}"] * 10)}]' for k in range(1, 9)]
) + '}'  # fmt: skip
_NESTED = ('[' * 3000, '{"a":' * 3000, '[' * 3000 + ']' * 3000, '- ' * 3000)
_NUMBER = re.compile(rb'-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?')
_TOKEN = re.compile(rb'[\w.+-]+')

Mutation = Callable[[bytes, np.random.Generator], bytes]


def mutated_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Data with one to four changes of bits, bytes, numbers, or of its length."""
    for _ in range(int(rng.integers(1, _MOST + 1))):
        data = _pick(_BYTES, rng)(data, rng)
    return data


def mutated_text(data: bytes, rng: np.random.Generator) -> bytes:
    """A text with one to four changes of its words and lines, now and then of its bytes."""
    for _ in range(int(rng.integers(1, _MOST + 1))):
        data = _pick(_TEXTS, rng)(data, rng)
    return data


def _pick(several: tuple[Mutation, ...], rng: np.random.Generator) -> Mutation:
    return several[int(rng.integers(len(several)))]


def _place(data: bytes, rng: np.random.Generator) -> int:
    return int(rng.integers(len(data) + 1))


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    if not data:
        return data
    changed, place = bytearray(data), int(rng.integers(len(data)))
    changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _overwrite(data: bytes, rng: np.random.Generator) -> bytes:
    """A number of 1 to 8 bytes at a place that is often a multiple of four."""
    size = int(rng.choice([1, 2, 4, 8]))
    if rng.random() < 0.3:
        number = bytes(rng.integers(0, 256, size, dtype=np.uint8))
    else:
        value = int(_EDGES[int(rng.integers(len(_EDGES)))]) + int(rng.integers(-1, 2))
        number = (value % 256**size).to_bytes(size, 'little')
    place = _place(data, rng)
    place -= place % 4 if rng.random() < 0.7 else 0
    return data[:place] + number + data[place + size :]


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: _place(data, rng)]


def _remove(data: bytes, rng: np.random.Generator) -> bytes:
    place = _place(data, rng)
    return data[:place] + data[place + int(rng.integers(1, 64)) :]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    place = _place(data, rng)
    part = data[place : place + int(rng.integers(1, 256))]
    return data[:place] + part * int(rng.integers(1, 4)) + data[place:]


def _swap(data: bytes, rng: np.random.Generator) -> bytes:
    a, b, c = sorted(_place(data, rng) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


def _zero(data: bytes, rng: np.random.Generator) -> bytes:
    place, size = _place(data, rng), int(rng.integers(1, 600))
    return data[:place] + bytes(len(data[place : place + size])) + data[place + size :]


def _replace(pattern: re.Pattern[bytes]) -> Mutation:
    def replace(data: bytes, rng: np.random.Generator) -> bytes:
        found = list(pattern.finditer(data))
        if not found:
            return data
        chosen = found[int(rng.integers(len(found)))]
        word = _WORDS[int(rng.integers(len(_WORDS)))].encode()
        return data[: chosen.start()] + word + data[chosen.end() :]

    return replace


def _exchange(data: bytes, rng: np.random.Generator) -> bytes:
    """A word in the place of another one."""
    found = list(_TOKEN.finditer(data))
    if not found:
        return data
    into, of = (found[int(rng.integers(len(found)))] for _ in range(2))
    return data[: into.start()] + of.group() + data[into.end() :]


def _nest(data: bytes, rng: np.random.Generator) -> bytes:
    """Much in little: names of names, or brackets in brackets, for a word."""
    found = list(_TOKEN.finditer(data))
    text = (*_NESTED, _BOMB)[int(rng.integers(len(_NESTED) + 1))].encode()
    if not found:
        return text
    chosen = found[int(rng.integers(len(found)))]
    return data[: chosen.start()] + text + data[chosen.end() :]


def _lines(data: bytes, rng: np.random.Generator) -> bytes:
    """A line that is removed, repeated, moved, or joined with the next."""
    lines = data.split(b'\n')
    place = int(rng.integers(len(lines)))
    line = lines.pop(place)
    how = int(rng.integers(4))
    if how == 1:
        lines[place:place] = [line, line]
    elif how == 2:
        lines.insert(int(rng.integers(len(lines) + 1)), line)
    elif how == 3 and lines:
        lines[place % len(lines)] = line + lines[place % len(lines)]
    return b'\n'.join(lines)


def _recode(data: bytes, rng: np.random.Generator) -> bytes:
    text = data.decode('utf-8', 'replace')
    code = ('utf-16', 'utf-8-sig', 'latin-1', 'utf-32')[int(rng.integers(4))]
    return text.encode(code, 'replace')


def _line_ends(data: bytes, rng: np.random.Generator) -> bytes:
    return data.replace(b'\n', (b'\r', b'\r\n', b'\n\n', b' ')[int(rng.integers(4))])


_BYTES = (_flip, _flip, _overwrite, _overwrite, _overwrite, _cut, _remove, _repeat, _swap, _zero)
_TEXTS = (
    *(_replace(_NUMBER), _replace(_NUMBER), _replace(_NUMBER), _replace(_TOKEN), _exchange),
    *(_exchange, _lines, _lines, _nest, _flip, _cut, _remove, _recode, _line_ends),
)
