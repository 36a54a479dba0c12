# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report in a headless Chromium: it loads alone, plays, seeks, and draws what it should.

Needs Playwright (the package) and a Chromium: Playwright's own, or one that is installed.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import shutil
from typing import Any

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.scenes.state import rotate_quaternions, Trajectory
from rigid_gns_core.scoring.evaluate import evaluate
from rigid_gns_core.show import Comparison, write_report

pytestmark = pytest.mark.browser

NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')
FRAMES, DT = 41, 0.1
# a software renderer, so that no GPU is needed
FLAGS = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader']
SCENE = Scene(surfaces=Plane.box(20.0, 20.0))


def moving(speed: float) -> Trajectory:
    """Two spheres that touch, and a third: along x, and at 1 rad/s around z."""
    times = DT * np.arange(FRAMES)[:, None, None]
    places = np.array([[-4.0, 0.0, 1.0], [-4.0, 2.0, 1.0], [-4.0, -5.0, 1.0]])
    positions = places + times * [speed, 0.0, 0.0]
    identity = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, 3, 1))
    turns = np.broadcast_to(times * [0.0, 0.0, 1.0], positions.shape)
    quaternions = rotate_quaternions(identity, turns)
    return Trajectory.from_poses(positions, quaternions, DT)


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip(
        'playwright.sync_api', reason='the page is tested by Playwright: pip install playwright'
    )
    with playwright.sync_playwright() as started:
        path = next(filter(None, map(shutil.which, NAMES)), None)
        if path is None and not Path(started.chromium.executable_path).exists():
            pytest.skip(f'no Chromium: none of {", ".join(NAMES)}, and none of Playwright')
        chromium = started.chromium.launch(executable_path=path, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """Yield an open report; at the end it has written no error and asked for nothing."""
    ours, reference = moving(1.5), moving(1.0)
    comparison = Comparison(
        title='lanes',
        scene=SCENE,
        predicted=ours,
        reference=reference,
        evaluation=evaluate(ours, reference, SCENE),
        recording={'lateness': (np.arange(5.0), np.ones(5))},
    )
    path = write_report(tmp_path / 'report.html', comparison)
    opened = browser.new_page(viewport={'width': 1000, 'height': 800})
    complaints: list[str] = []
    opened.on('pageerror', lambda error: complaints.append(str(error)))
    opened.on(
        'console', lambda m: complaints.append(m.text) if m.type in ('error', 'warning') else None
    )
    opened.on(
        'request',
        lambda r: None if r.url.startswith(('data:', 'blob:')) else complaints.append(r.url),
    )
    opened.goto(path.as_uri())
    opened.wait_for_selector('html[data-ready=yes]')
    yield opened
    opened.close()
    # software rendering is slow, and Chromium says so
    assert [c for c in complaints if c != path.as_uri() and 'GPU stall' not in c] == []


def place(page: Any, side: int, sphere: int) -> list[float]:
    """Where a sphere is drawn [m]."""
    return page.evaluate(
        '([side, sphere]) => Array.from(report.player.stage.sides[side].mesh.instanceMatrix.array'
        '.slice(16 * sphere + 12, 16 * sphere + 15))',
        [side, sphere],
    )


def test_the_scrubber_seeks(page: Any) -> None:
    page.evaluate(
        "() => { const s = document.getElementById('scrubber'); s.value = 2.05;"
        "s.dispatchEvent(new Event('input')); }"
    )
    np.testing.assert_allclose(place(page, 0, 0), [-4.0 + 1.5 * 2.05, 0.0, 1.0], atol=2e-3)
    np.testing.assert_allclose(place(page, 1, 2), [-4.0 + 2.05, -5.0, 1.0], atol=2e-3)
    assert page.text_content('#clock').startswith('2.05')
    page.click('#forth')
    assert page.text_content('#clock').startswith('2.10')
    page.click('#back')
    assert page.text_content('#clock').startswith('2.00')
    page.click('.chart[data-key=energy] .u-over', position={'x': 0, 'y': 50})
    assert page.text_content('#clock').startswith('0.0')


def test_spheres_turn(page: Any) -> None:
    page.evaluate('() => report.player.seek(2.05)')
    turned = page.evaluate(
        '() => Array.from(report.player.stage.sides[0].mesh.instanceMatrix.array.slice(0, 11))'
    )
    wanted = [np.cos(2.05), np.sin(2.05), 0, 0, -np.sin(2.05), np.cos(2.05), 0, 0, 0, 0, 1]
    np.testing.assert_allclose(turned, wanted, atol=0.02)  # of levels of 1/127


def test_it_plays_to_the_end_and_stops(page: Any) -> None:
    page.select_option('#speed', '10')
    assert place(page, 0, 0)[0] == pytest.approx(-4.0, abs=2e-3)
    page.click('#play')
    page.wait_for_function('() => !report.player.playing')
    assert place(page, 0, 0)[0] == pytest.approx(-4.0 + 1.5 * DT * (FRAMES - 1), abs=2e-3)


def test_the_picture_changes_with_time_and_view(page: Any) -> None:
    stage = page.locator('#stage canvas')
    before = stage.screenshot()
    page.evaluate('() => report.player.seek(4)')
    page.evaluate('() => report.player.stage.draw()')
    later = stage.screenshot()
    assert later != before
    page.select_option('#view', 'overlay')
    page.evaluate('() => report.player.stage.draw()')
    assert stage.screenshot() not in (before, later)


def test_colours_show_error_speed_and_island(page: Any) -> None:
    def colours(mode: str, side: int = 0) -> np.ndarray:
        page.select_option('#colour', mode)
        found = page.evaluate(
            'side => Array.from(report.player.stage.sides[side].mesh.instanceColor.array)', side
        )
        return np.array(found).reshape(3, 3)

    page.evaluate('() => report.player.seek(0)')
    assert colours('error')[0] == pytest.approx([0.054, 0.0, 0.087], abs=0.01)  # dark: no error
    page.evaluate('() => report.player.seek(4)')  # 2 radii off
    assert colours('error')[0, 1] > 0.3
    islands = colours('island')
    assert np.array_equal(islands[0], islands[1]) and not np.array_equal(islands[0], islands[2])
    assert not np.array_equal(colours('speed', 0)[0], colours('speed', 1)[0])


def test_charts_and_tables_are_there(page: Any) -> None:
    keys = page.eval_on_selector_all('.chart', 'cards => cards.map(card => card.dataset.key)')
    assert keys == ['error', 'energy', 'penetration', 'momentum', 'spin', 'lateness']
    assert page.locator('.chart canvas').count() == len(keys)
    assert float(page.text_content('[data-key="errors.position_error"]')) > 0.9
