# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes a GIF of the replay in a report with a headless Chromium.

    python benchmarks/film.py ood_c.h5 --reference bullet_c.h5 --out docs/images/rollout.gif

Needs Playwright with a Chromium, and Pillow.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path
import shutil
import sys
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright
from rigid_gns_core.commands.comparison_arguments import add_source, read_comparison
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.show import write_report

FLAGS = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader']
# the replay alone, with the time in its corner
STYLE = """
#stage { position: fixed; inset: 0; width: 100vw; height: 100vh; border: 0; border-radius: 0; }
#clock { position: absolute; right: 14px; top: 10px; font-size: 14px; }
"""
CAMERA = """([turn, rise, zoom]) => {
  const stage = report.player.stage, { camera, controls, up } = stage;
  document.getElementById('stage').append(document.getElementById('clock'));
  stage.draw();  // from where a reader sees it first
  const out = camera.position.clone().sub(controls.target).divideScalar(zoom);
  const right = up.clone().cross(out).normalize();
  out.applyAxisAngle(right, -rise * Math.PI / 180).applyAxisAngle(up, turn * Math.PI / 180);
  camera.position.copy(controls.target).add(out);
  controls.update();
}"""
SEEK = """time => {
  report.player.seek(time);
  report.player.stage.draw();
  document.getElementById('clock').value = `${time.toFixed(1)} s`;
}"""


def take(page: Any, times: np.ndarray) -> list[Image.Image]:
    """Pictures of the page at times [s], shape (m,)."""
    pictures = []
    with Progress(len(times), 'film', unit='frame') as progress:
        for time in times:
            page.evaluate(SEEK, float(time))
            with Image.open(io.BytesIO(page.screenshot())) as shot:
                pictures.append(shot.convert('RGB').reduce(2))  # of twice the size: smooth edges
            progress.update()
    return pictures


def write_gif(path: Path, pictures: list[Image.Image], fps: float) -> None:
    """Write pictures with one common palette, so that colours do not flicker."""
    some = np.concatenate([np.asarray(p) for p in pictures[:: max(1, len(pictures) // 6)]])
    palette = Image.fromarray(some).quantize(128, dither=Image.Dither.NONE)
    first, *rest = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    duration = round(1000 / fps)
    first.save(path, save_all=True, append_images=rest, duration=duration, loop=0, disposal=1)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_source(parser)
    parser.add_argument('--out', required=True, type=Path, metavar='GIF')
    parser.add_argument('--size', type=int, nargs=2, default=(800, 340), metavar=('W', 'H'))
    parser.add_argument('--fps', type=float, default=15.0, help='pictures a second (default 15)')
    parser.add_argument('--start', type=float, default=0.0, help='first time [s]')
    parser.add_argument('--stop', type=float, default=np.inf, help='last time [s]')
    parser.add_argument('--turn', type=float, default=0.0, help='camera to the right [degrees]')
    parser.add_argument('--rise', type=float, default=0.0, help='camera upwards [degrees]')
    parser.add_argument('--zoom', type=float, default=1.0, help='camera nearer by this factor')
    arguments = parser.parse_args()
    comparison = read_comparison(arguments)
    stop = min(arguments.stop, float(comparison.predicted.times[-1]))
    times = np.arange(arguments.start, stop + 1e-9, 1.0 / arguments.fps)
    width, height = arguments.size
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        report = write_report(Path(folder) / 'report.html', comparison)
        browser = playwright.chromium.launch(executable_path=shutil.which('chromium'), args=FLAGS)
        page = browser.new_page(viewport={'width': width, 'height': height}, device_scale_factor=2)
        page.goto(report.as_uri())
        page.wait_for_selector('html[data-ready=yes]')
        page.add_style_tag(content=STYLE)
        page.evaluate(CAMERA, [arguments.turn, arguments.rise, arguments.zoom])
        pictures = take(page, times)
        browser.close()
    write_gif(arguments.out, pictures, arguments.fps)
    print(f'{len(pictures)} pictures; wrote {arguments.out}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
