# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers and tables as text: one format for the terminal and for Markdown."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from tabulate import tabulate


def format_rows(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    left: Collection[int] = (0,),
    markdown: bool = False,
) -> str:
    """Table of cells that are text already; a column that is empty throughout is left out.

    Args:
        head: Names of the columns.
        rows: Cells of each row, as many as columns.
        left: Columns aligned left, as words are; -1 is the last. The others are aligned right.
        markdown: Lay it out as Markdown, not for a terminal.
    """
    words = {place % len(head) for place in left}
    lines = [head, *rows]
    shown = [place for place in range(len(head)) if any(line[place] for line in lines)]
    text: str = tabulate(
        [[line[place] for place in shown] for line in lines],
        headers='firstrow',
        tablefmt='pipe' if markdown else 'simple',
        colalign=['left' if place in words else 'right' for place in shown],
        disable_numparse=True,
    )
    return text


def number(value: float | None, digits: int = 3) -> str:
    """`digits` significant digits without trailing zeros; '-' for None, 'inf' for infinity."""
    if value is None:
        return '-'
    if value == 0 or not np.isfinite(value):
        return f'{value:g}'
    mantissa, exponent = f'{value:.{digits - 1}e}'.split('e')
    power = int(exponent)
    if not -3 <= power < 5:
        return f'{mantissa}e{power}'
    text = f'{float(f"{mantissa}e{power}"):.{max(0, digits - 1 - power)}f}'
    return text.rstrip('0').rstrip('.') if '.' in text else text


def mean_std(mean: float | None, std: float | None, digits: int = 3) -> str:
    """`mean ± std`, or the mean alone where there is no deviation."""
    text = number(mean, digits)
    return text if std is None else f'{text} ± {number(std, 2)}'


def summary(entry: Mapping[str, Any] | None, digits: int = 3) -> str:
    """`mean ± std` of the finite values, and how many are infinite: '1.2 ± 0.3, inf in 1 of 9'.

    Args:
        entry: `count`, `infinite`, `mean` and `std`; where the latter two are infinite,
            `finite_mean` and `finite_std`. None: nothing was measured.
        digits: Significant digits of the mean.
    """
    if entry is None:
        return '-'
    if entry['infinite'] == entry['count']:
        return 'inf'
    mean, std = (entry.get(f'finite_{name}', entry[name]) for name in ('mean', 'std'))
    text = mean_std(mean, std or None, digits)
    return f'{text}, inf in {entry["infinite"]} of {entry["count"]}' if entry['infinite'] else text
