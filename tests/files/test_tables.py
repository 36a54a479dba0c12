# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from rigid_gns_core.files.tables import format_rows, mean_std, number, summary


def test_numbers_are_short() -> None:
    values = (0.0, 1.0, 123.4, 1234.5, 99999.0, 0.01234, 3.36e5, 1e-7, -2.5, float('inf'), None)
    assert [number(value) for value in values] == [
        '0',
        '1',
        '123',
        '1230',
        '1.00e5',
        '0.0123',
        '3.36e5',
        '1.00e-7',
        '-2.5',
        'inf',
        '-',
    ]
    # a number that is rounded up to the next power of ten keeps its digits
    assert [number(9.996), number(0.09996), number(99999.6, 6)] == ['10', '0.1', '99999.6']
    assert number(0.0123456, 2) == '0.012'


def test_deviations_and_infinite_values_are_told() -> None:
    assert (mean_std(2.0, 0.25), mean_std(2.0, None)) == ('2 ± 0.25', '2')
    entry = {'mean': 2.0, 'std': 0.5, 'count': 3, 'infinite': 0}
    assert (summary(entry), summary(None)) == ('2 ± 0.5', '-')
    lost = {'mean': float('inf'), 'std': float('inf'), 'count': 3}
    finite = {'finite_mean': 2.0, 'finite_std': 0.5}
    assert summary({**lost, **finite, 'infinite': 1}) == '2 ± 0.5, inf in 1 of 3'
    assert summary({**lost, 'infinite': 3}) == 'inf'


def test_columns_are_aligned() -> None:
    head, rows = ('name', 'a', 'b', ''), [('one', '1.5', '10', 'odd'), ('longer', '22', '-', '')]
    assert format_rows(head, rows, left=(0, -1)).splitlines() == [
        'name      a    b',
        '------  ---  ---  ---',
        'one     1.5   10  odd',
        'longer   22    -',
    ]
    assert format_rows(head, [('one', '', '2', '')]).splitlines() == [
        'name      a    b',
        '------  ---  ---',
        'one            2',
    ]
    assert format_rows(head, rows, markdown=True).splitlines()[:3] == [
        '| name   |   a |   b |     |',
        '|:-------|----:|----:|----:|',
        '| one    | 1.5 |  10 | odd |',
    ]
