# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the pages of this folder become a site: `make docs`.

Equations are plain text and names of the code, not TeX: MathJax would be fetched from a network,
and GitHub, the site and an editor then show the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
import os
from pathlib import Path
import re
import sys
from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))  # the sources of this tree, whatever is installed
os.environ['NUMBA_DISABLE_JIT'] = '1'  # compiled functions are none to autodoc

project = 'rigid_gns_ros'
author = 'rigid_gns maintainers'
project_copyright = f'{author}, Apache-2.0'
release = ElementTree.parse(ROOT / 'package.xml').findtext('version', '')

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx.ext.viewcode']
html_theme = 'furo'
html_title = f'rigid_gns_ros {release}'
html_static_path = ['_static']
html_css_files = ['site.css']
html_show_sourcelink = False
html_copy_source = False

myst_heading_anchors = 4  # links to `page.md#heading`, named as GitHub names them
default_role = 'py:obj'  # `Scene` in a docstring is a link where there is a page of it

napoleon_numpy_docstring = False
autodoc_member_order = 'bysource'
autodoc_default_options = {'members': True}
autodoc_inherit_docstrings = False  # torch tells every `forward` what a forward is
# types beside what a docstring says of an argument, not a second time in the signature
autodoc_typehints = 'description'
autodoc_typehints_description_target = 'documented'
autodoc_typehints_format = 'short'
autodoc_type_aliases = {
    name: name
    for name in ('Array', 'ArrayLike', 'Flags', 'Floats', 'Indices', 'PerSphere')
    + ('Tensors', 'Vector')
}
python_maximum_signature_line_length = 60
toc_object_entries_show_parents = 'hide'
# two modules may have a class of one name: a link to the first is no reason to build nothing
suppress_warnings = ['ref.python']
# ROS is never imported: its wheels start the process anew, and a page needs none of it. The others
# may be missing: torch is an extra, and Bullet has no wheel for Python 3.12.
autodoc_mock_imports = ['geometry_msgs', 'rclpy', 'std_msgs', 'std_srvs']
autodoc_mock_imports += [name for name in ('pybullet', 'torch') if find_spec(name) is None]

# Pages of files that lie at the root of the repository: what docs/ has of them is one line for who
# reads it on GitHub.
MIRRORS = {
    'overview': 'README.md',
    'contributing': 'CONTRIBUTING.md',
    'changelog': 'CHANGELOG.rst',
}


def mirror(app: Sphinx, docname: str, content: list[str]) -> None:
    """Take the file at the root for its page."""
    if docname in MIRRORS:
        path = ROOT / MIRRORS[docname]
        app.env.note_dependency(str(path), docname=docname)
        content[0] = path.read_text(encoding='utf-8')


def follow_links(app: Sphinx, docname: str, content: list[str]) -> None:
    """Let relative links of Markdown lead where they lead on GitHub.

    A link to a file at the root becomes one to its page, a link to a folder one to its README.md.
    Every other file, as ../config/box.yaml, MyST copies into the site. What is not there is left
    as it is: MyST warns of it.
    """
    page = DOCS / f'{docname}.md'
    if Path(app.env.doc2path(docname)) != page:
        return
    folder = ROOT if docname in MIRRORS else page.parent
    pages = {ROOT / name: DOCS / f'{doc}{Path(name).suffix}' for doc, name in MIRRORS.items()}

    def follow(link: re.Match[str]) -> str:
        target = Path(os.path.normpath(folder / link[1]))
        if (target / 'README.md').is_file():
            target /= 'README.md'
        if not target.is_file():
            return link[0]
        place = os.path.relpath(pages.get(target, target), page.parent)
        return f']({Path(place).as_posix()}{link[2] or ""})'

    content[0] = re.sub(r'\]\(([\w./-]+)(#[\w-]+)?\)', follow, content[0])


def escape_bars(*event: Any) -> None:
    """Bars in docstrings are absolute values, |v|, where reST sees a substitution."""
    lines: list[str] = event[-1]
    lines[:] = [re.sub(r'(`+[^`]*`+)|\|', lambda m: m[1] or r'\|', line) for line in lines]


def leave_out(_app: Sphinx, _kind: str, _name: str, item: Any, *_: Any) -> bool | None:
    """Fields of a NamedTuple: their only text is that they are field number so-and-so."""
    return True if type(item).__name__ == '_tuplegetter' else None


def link_code(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Let names on the page of equations lead to the API: to themselves, or what they are of."""
    if docname != 'physics':
        return
    known = app.env.domains.python_domain.objects

    def places(text: str) -> Iterator[Any]:
        while '.' in text:
            # a name of a module, or one that the package itself has
            for name in (text, text.partition('.')[2]):
                if f'rigid_gns_core.{name}' in known:
                    yield known[f'rigid_gns_core.{name}']
            text = text.rpartition('.')[0]

    for name in list(doctree.findall(nodes.literal)):
        if place := next(places(name.astext()), None):
            page = app.builder.get_relative_uri(docname, place.docname)
            link = nodes.reference('', '', refuri=f'{page}#{place.node_id}', internal=True)
            name.replace_self(link)
            link += name


def no_way_back(_app: Sphinx, page: str, _template: str, context: dict[str, Any], _: Any) -> None:
    """Make listings without "[docs]": it misses what a package offers under a name of its own."""
    if page.startswith('_modules/') and 'body' in context:
        context['body'] = re.sub(r'<a class="viewcode-back"[^>]*>.*?</a>', '', context['body'])


def setup(app: Sphinx) -> None:
    """Set up this extension; Sphinx calls it."""
    app.connect('source-read', mirror, priority=400)
    app.connect('source-read', follow_links)
    app.connect('doctree-resolved', link_code)
    app.connect('html-page-context', no_way_back)
    app.connect('autodoc-process-docstring', escape_bars)
    app.connect('autodoc-skip-member', leave_out)
