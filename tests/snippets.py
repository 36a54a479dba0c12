# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Snippets of the pages, and a reader who types all of a page, in order, into one folder.

What cannot run here is checked as far as it goes: `PARSED` by the command's own parser, nodes and
launch files by the parameters and arguments that they declare (tests/ros starts the nodes),
`FOREIGN` not at all.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
from dataclasses import dataclass
import importlib
import io
from itertools import pairwise
import os
from pathlib import Path
import re
import runpy
import shlex
import sys
from typing import Any
import warnings

import pytest
from rigid_gns_core.commands import cli
from rigid_gns_core.forecasts.node_parameters import SIMULATOR, TRACKER
import yaml

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / 'README.md'
PAGES = [README, *sorted((ROOT / 'docs').glob('*.md'))]
# folder of the shipped files, as the shell finds it
SHARE = '$(ros2 pkg prefix --share rigid_gns_ros)'
NODES = {'simulator': SIMULATOR, 'tracker': TRACKER}
# Ways of others to install and set up, which need a network or an apt ROS.
FOREIGN = {'python3', 'pip', 'rosdep', 'colcon', '.'}
# Only parsed, where one of these words is in it: a cluster, a browser, hours.
PARSED = {
    '--scheduler', 'recordings', 'benchmarks/only_what_is_needed.py', 'benchmarks/film.py',
}  # fmt: skip
# Numbers of a page may be rounded, and another processor rounds differently; counts are exact.
CLOSE = 0.25
NUMBER = re.compile(r'(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)')


@dataclass(frozen=True)
class Snippet:
    """A fenced block: the language it names, its text, and the line of the page it begins at."""

    kind: str
    text: str
    line: int


def snippets(page: Path) -> list[Snippet]:
    """Fenced blocks of a page."""
    text = page.read_text(encoding='utf-8')
    blocks = re.finditer(r'^```([^\n`]*)\n(.*?)^```$', text, re.M | re.S)
    return [Snippet(b[1], b[2], text.count('\n', 0, b.start()) + 1) for b in blocks]


def commands(shell: str) -> list[list[str]]:
    """Words of each command of a shell snippet."""
    lines = shell.replace('\\\n', ' ').splitlines()
    parts = [part for line in lines for part in line.split('&&')]
    split = (shlex.split(part, comments=True) for part in parts)
    return [[word for word in words if word != '&'] for words in split if words]


def mentioned(page: Path) -> list[list[str]]:
    """Words of commands in the text of a page, with placeholders such as BAG, and of usages."""
    found = re.findall(
        r'`((?:rigid-gns|evaluate|python benchmarks/\S+|ros2 run|ros2 launch) [^`]+)`',
        page.read_text(encoding='utf-8'),
    )
    starts = ('rigid-gns ', 'evaluate ', 'python benchmarks/')
    blocks = [s.text for s in snippets(page) if s.kind in ('', 'text')]
    found += [text.replace('\n', ' ') for text in blocks if text.startswith(starts)]
    return [text.split() for text in found]


def quick(words: list[str]) -> list[str]:
    """Options after which a command that takes minutes or hours is quick; all else is as printed.

    Of an option that is given twice, the last counts.
    """
    if words[1] == 'generate':
        one = '--scene' in words
        rest = ['--substeps', '4'] if one else ['--trajectories', '4', '--workers', '1']
        return ['--steps', '2', *rest]
    if words[1:3] == ['experiment', 'worlds']:
        return ['--budget', 'smoke', '--only', 'soft']
    if words[1] == 'experiment' and not {'--page', '--list'} & set(words):
        smoke = 'smoke' in words
        return ['--only', 'base', '--workers', '1'] if smoke else ['--budget', 'smoke', '--no-run']
    return {
        'closed-forms': ['--quick'],
        'train': ['--steps', '1'],
        'calibrate': ['--windows', '5'],
        'hard-cases': ['--quick', '--cases', 'corner', 'half_below'],
        'benchmark': ['--quick', '--scenes', 'billiards', '--no-scaling', '--no-processes'],
    }.get(words[1], [])


class Reader:
    """Types snippets one after the other into the current folder.

    Args:
        quick: Options to add to the words of a `rigid-gns` command.
    """

    def __init__(self, quick: Callable[[list[str]], Sequence[str]] = quick) -> None:
        self.quick = quick
        self.namespace: dict[str, Any] = {}
        # what the last snippet printed; None: nothing to compare with
        self.printed: str | None = None

    def read(self, page: Path) -> None:
        """Type all snippets of a page; those of kind `text` must be what was printed before."""
        for snippet in snippets(page):
            where = f'{page.name}:{snippet.line}'
            with _at(where):
                if snippet.kind == 'sh':
                    self.type(snippet.text)
                elif snippet.kind == 'python':
                    self.execute(snippet.text, where)
                elif snippet.kind == 'text' and self.printed is not None:
                    check_printed(snippet.text, self.printed)
                else:
                    self.printed = None
                    if snippet.kind == 'yaml':
                        self.save(snippet.text)

    def type(self, shell: str) -> None:
        """Run all commands of a shell snippet."""
        self.printed = ''
        for words in commands(shell):
            if PARSED & set(words):
                parse(words)
            elif words[0] == 'rigid-gns':
                self._run(cli.main, words[1:], self.quick(words))
            elif words[:4] == ['ros2', 'run', 'rigid_gns_ros', 'evaluate']:
                self._run(cli.evaluate, words[4:])
            elif words[0] == 'make':
                target = next(word for word in words[1:] if '=' not in word)
                makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
                assert re.search(rf'^{target}:.*## ', makefile, re.M), target
            elif words[0] == 'ros2':
                check_ros(words)
            elif words[0] == 'rviz2':
                assert (ROOT / words[-1].partition(')/')[2]).is_file(), words
            else:
                assert words[0] in FOREIGN, words

    def _run(
        self, main: Callable[[list[str]], int], words: list[str], added: Sequence[str] = ()
    ) -> None:
        heard = io.StringIO()
        with contextlib.redirect_stdout(heard):
            code = main([*(os.path.expandvars(word) for word in words), *added])
        assert code == 0, (words, heard.getvalue())
        # what was made quicker prints something else
        self.printed = None if added or self.printed is None else self.printed + heard.getvalue()

    def execute(self, code: str, where: str) -> None:
        """Run Python; numbers in the comment behind a `print` are those that it prints."""
        heard = io.StringIO()
        with warnings.catch_warnings(), contextlib.redirect_stdout(heard):
            warnings.simplefilter('error')  # an example has nothing to warn of
            exec(compile(code, where, 'exec'), self.namespace)
        self.printed = heard.getvalue()
        lines = iter(self.printed.splitlines())
        for comment in re.findall(r'^print\(.*\)  # (.*\d.*)$', code, re.M):
            assert any(_says(comment, line) for line in lines), (comment, self.printed)

    def save(self, text: str) -> None:
        """Save YAML under the name in its first line, `# NAME` or `# added to NAME`."""
        if name := re.match(r'# (added to )?(\S+\.yaml)\n', text):
            with open(name[2], 'a' if name[1] else 'w', encoding='utf-8') as file:
                file.write(text)


def check_printed(expected: str, printed: str) -> None:
    """Lines of `expected` are in `printed`, in this order; `...` stands for what is left out."""
    lines = iter(printed.splitlines())
    for line in expected.splitlines():
        if line.strip() != '...':
            found = any(_same_line(line.strip(), other.strip()) for other in lines)
            assert found, f'not printed, or not in this order: {line!r}; printed was\n{printed}'


def _same_line(expected: str, printed: str) -> bool:
    pattern = ''
    for part in re.split(rf'({NUMBER.pattern}|\.\.\.|\s+)', expected):
        if NUMBER.fullmatch(part):
            pattern += f'({NUMBER.pattern})'
        elif part == '...':
            pattern += '.*'
        else:
            pattern += r'\s+' if part.isspace() else re.escape(part)
    match = re.fullmatch(pattern, printed)
    return match is not None and _same_numbers(NUMBER.findall(expected), match.groups())


def _says(comment: str, printed: str) -> bool:
    numbers = NUMBER.findall(printed)
    return numbers != [] and _same_numbers(NUMBER.findall(comment)[: len(numbers)], numbers)


def _same_numbers(expected: Sequence[str], printed: Sequence[str]) -> bool:
    return len(expected) == len(printed) and all(
        one == other
        if one.isdigit() and other.isdigit()
        else float(other) == pytest.approx(float(one), rel=CLOSE)
        for one, other in zip(expected, printed, strict=True)
    )


class _Parsed(BaseException):
    """The parser of a script took its words."""


def parse(words: list[str]) -> None:
    """Let the parser of a `rigid-gns` command or of a script read its words, and no more."""
    if words[0] == 'rigid-gns':
        cli.make_parser(words[1]).parse_args(words[1:])
        return
    script, read = ROOT / words[1], argparse.ArgumentParser.parse_args

    def stop(parser: argparse.ArgumentParser, *arguments: Any) -> None:
        read(parser, *arguments)
        raise _Parsed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, 'parse_args', stop)
        patch.setattr(sys, 'argv', words[1:])
        patch.syspath_prepend(script.parent)
        with pytest.raises(_Parsed):
            runpy.run_path(str(script), run_name='__main__')


def check_ros(words: list[str]) -> None:
    """Check a node and the parameters that it declares, or a launch file and its arguments."""
    verb, package, name, *rest = words[1:]
    assert package == 'rigid_gns_ros', words
    if verb == 'launch':
        text = (ROOT / 'launch' / name).read_text(encoding='utf-8')
        for argument in rest:
            assert f"'{argument.split(':=')[0]}'" in text, argument
        return
    assert verb == 'run', words
    if name == 'evaluate':  # BAG stands for a bag
        check_options(['evaluate', *rest])
        return
    declared = {spec.name: spec for spec in NODES[name]}
    for flag, word in pairwise(rest):
        if flag == '-p':
            key, value = word.split(':=')
            spec = declared[key]
            value = yaml.safe_load(os.path.expandvars(value))
            assert isinstance(value, type(spec.default)), word
            assert spec.problem(value) is None, word
        elif flag == '--params-file':
            assert Path(word.replace(SHARE, str(ROOT))).is_file(), word


def check_options(words: list[str]) -> None:
    """Each option of a command that a text mentions is there."""
    if words[0] == 'ros2':
        check_ros(words)
        return
    if words[0] == 'python':
        known = (ROOT / words[1]).read_text(encoding='utf-8')
    else:
        known = _parser(words).format_help()
    for option in (word.strip('[]') for word in words):
        if option.startswith('--'):
            assert re.search(rf'(?<!\w){re.escape(option)}\b', known), option


def _parser(words: list[str]) -> argparse.ArgumentParser:
    """Return that of `rigid-gns`, a command of it, or `evaluate`, without words but options."""
    name = words[1] if words[0] == 'rigid-gns' else words[0]
    if name not in cli.COMMANDS:
        return cli.make_parser()
    parser, (module, _) = argparse.ArgumentParser(), cli.COMMANDS[name]
    importlib.import_module(module).add_arguments(parser)
    return parser


@contextlib.contextmanager
def _at(where: str) -> Iterator[None]:
    """Failures name the snippet."""
    try:
        yield
    except (Exception, SystemExit) as error:
        raise AssertionError(f'{where}: {type(error).__name__}: {error}') from error
