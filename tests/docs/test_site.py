# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The site of docs/: it builds without a warning, has all pages and names, asks for nothing."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
import importlib
import importlib.util
from pathlib import Path
import re
import shutil
import subprocess
import sys
from types import ModuleType
from typing import Any

import pytest
import rigid_gns_core

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
PHYSICS = (DOCS / 'physics.md').read_text(encoding='utf-8')
# names of modules with something in them, as physics.md shortens them
NAMES = sorted(set(re.findall(r'`([a-z_]+(?:\.\w+)+)`', PHYSICS)))

SLOW = pytest.mark.slow  # half a minute for the build, which all that are marked share

missing = [
    package
    for package in ('sphinx', 'myst_parser', 'furo')
    if importlib.util.find_spec(package) is None
]
needs_sphinx = pytest.mark.skipif(
    bool(missing), reason=f'not installed: {missing}; pip install ".[docs]" in the clone'
)


@pytest.fixture(scope='module')
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the built site."""
    folder = tmp_path_factory.mktemp('site')
    build = [sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-q', '-b', 'html']
    done = subprocess.run(
        [*build, str(DOCS), str(folder)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder


def links(page: Path, attribute: str) -> set[str]:
    """Return what a page refers to in `href` or `src`."""
    return set(re.findall(rf'\b{attribute}="([^"]*)"', page.read_text(encoding='utf-8')))


@needs_sphinx
@SLOW
def test_every_page_can_be_reached_from_the_first(site: Path) -> None:
    sources = [path for kind in ('md', 'rst') for path in DOCS.rglob(f'*.{kind}')]
    assert {'tutorial.md', 'physics.md', 'node.md', 'thesis.md'} <= {p.name for p in sources}
    found, left = set(), {site / 'index.html'}
    while left:
        page = left.pop()
        found.add(page)
        local = {link.split('#')[0] for link in links(page, 'href')}
        pages = {(page.parent / link).resolve() for link in local if link.endswith('.html')}
        left |= {other for other in pages if other.is_file()} - found
    for source in sources:
        assert site / source.relative_to(DOCS).with_suffix('.html') in found, source


@needs_sphinx
@SLOW
def test_every_link_within_the_site_leads_somewhere(site: Path) -> None:
    anchors = {
        page.resolve(): set(re.findall(r'\bid="([^"]+)"', page.read_text(encoding='utf-8')))
        for page in site.rglob('*.html')
    }
    for page in anchors:
        for link in links(page, 'href') | links(page, 'src'):
            if not link or re.match(r'[a-z]+:', link):
                continue
            path, _, anchor = link.split('?')[0].partition('#')
            target = (page.parent / path).resolve() if path else page
            assert target.is_file(), (page.name, link)
            if anchor and target in anchors:
                assert anchor in anchors[target], (page.name, link)


@needs_sphinx
@SLOW
def test_the_site_opens_offline(site: Path) -> None:
    for page in site.rglob('*.html'):
        text = page.read_text(encoding='utf-8')
        fetched = re.findall(r'<(?:script|img|iframe|source)\b[^>]*\bsrc="(\w+:)?//', text)
        fetched += re.findall(r'<link\b[^>]*\bhref="(?:\w+:)?//[^"]*"', text)
        assert not fetched, (page.name, fetched)


@needs_sphinx
@SLOW
def test_every_public_name_is_in_the_api(site: Path) -> None:
    text = (site / 'api' / 'public.html').read_text(encoding='utf-8')
    for name in rigid_gns_core.__all__:
        assert f'id="rigid_gns_core.{name}"' in text, name


@needs_sphinx
@SLOW
def test_pages_of_files_at_the_root_hold_their_text(site: Path) -> None:
    for page, words in (
        ('overview.html', 'How good it is'),
        ('contributing.html', 'What a change needs'),
        ('changelog.html', 'Forthcoming'),
    ):
        assert words in (site / page).read_text(encoding='utf-8'), page


@needs_sphinx
@SLOW
def test_names_beside_equations_lead_to_the_api(site: Path) -> None:
    found = links(site / 'physics.html', 'href')
    for name in (
        'engine.contact_law.target_of',
        'gns.network.GNBlock',
        'State',
        'gns.graph.sphere_pairs',
    ):
        assert [link for link in found if link.endswith(f'#rigid_gns_core.{name}')], name


@pytest.mark.parametrize('page', [ROOT / 'README.md', *DOCS.rglob('*.md')], ids=lambda p: p.stem)
def test_rows_of_tables_have_the_cells_of_their_head(page: Path) -> None:
    """Markdown drops cells beyond those of the head without a word."""
    text = re.sub(r'^```.*?^```', '', page.read_text(encoding='utf-8'), flags=re.M | re.S)
    for table in re.findall(r'(?:^\|.*\n)+', text, re.M):
        head, *rows = (re.split(r'(?<!\\)\|', line) for line in table.splitlines())
        for row in rows:
            assert len(row) == len(head), row


def small_site(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Built from docs/conf.py and one page, beside a repository of few files."""
    for name, content in {
        'docs/index.md': f'# One\n\n{text}\n\n```{{toctree}}\noverview\nmodel/README\n```\n',
        'docs/overview.md': '# Stub\n',
        'docs/model/README.md': '# Numbers\n\n[all](numbers.json), [first](../../README.md)\n',
        'docs/model/numbers.json': '{}\n',
        'docs/_static/site.css': '',
        'config/box.yaml': 'scene: {}\n',
        'package.xml': '<package><version>1.2.3</version></package>\n',
        'README.md': '# First\n\n## Then\n\n[numbers](docs/model), [box](config/box.yaml)\n',
    }.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding='utf-8')
    shutil.copy(DOCS / 'conf.py', folder / 'docs')
    build = [sys.executable, '-m', 'sphinx', '-W', '-q', '-b', 'html']
    return subprocess.run(
        [*build, str(folder / 'docs'), str(folder / 'site')],
        capture_output=True,
        text=True,
        check=False,
    )


@needs_sphinx
def test_links_of_the_repository_lead_to_pages_or_copies(tmp_path: Path) -> None:
    text = '[first](../README.md#then), [numbers](model), [box](../config/box.yaml)'
    done = small_site(tmp_path, text)
    assert done.returncode == 0, done.stderr
    assert {'overview.html#then', 'model/README.html'} <= links(
        tmp_path / 'site/index.html', 'href'
    )
    overview = links(tmp_path / 'site/overview.html', 'href')
    assert 'model/README.html' in overview
    assert '../overview.html' in links(tmp_path / 'site/model/README.html', 'href')
    (box,) = (link for link in overview if link.endswith('/box.yaml'))
    assert (tmp_path / 'site' / box).read_text(encoding='utf-8') == 'scene: {}\n'


@needs_sphinx
@pytest.mark.parametrize('link', ['../config/none.yaml', 'none.md', '../README.md#none'])
def test_a_link_to_nothing_builds_nothing(link: str, tmp_path: Path) -> None:
    done = small_site(tmp_path, f'[nothing]({link})')
    assert done.returncode != 0
    assert 'index.md:3' in done.stderr


def part(owner: Any, name: str) -> Any:
    """Return an attribute, or a field that has no default."""
    if is_dataclass(owner) and name in {field.name for field in fields(owner)}:
        return name
    if isinstance(owner, ModuleType) and not hasattr(owner, name):
        return importlib.import_module(f'{owner.__name__}.{name}')
    return getattr(owner, name)


@pytest.mark.parametrize('name', NAMES)
def test_each_name_beside_an_equation_exists(name: str) -> None:
    pytest.importorskip('torch', reason='the reference is written in it')
    found: Any = importlib.import_module('rigid_gns_core')
    for other in name.split('.'):
        found = part(found, other)


def test_names_beside_equations_are_found() -> None:
    assert len(NAMES) > 70
