# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""`rigid-gns completion`: completion for a shell; and what the words of an option can be."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable

SHELLS = ('bash', 'zsh', 'fish')


def completes(
    action: argparse.Action, names: Callable[[], Iterable[str]] | Iterable[str]
) -> argparse.Action:
    """Let the shell offer names for an option that takes others too, such as files.

    Args:
        action: What `add_argument` returned.
        names: They, or what finds them when a shell asks.
    """

    def completer(**_: object) -> list[str]:  # argcomplete tells what was typed; it filters itself
        return list(names() if callable(names) else names)

    action.completer = completer  # type: ignore[attr-defined]  # where argcomplete looks for it
    return action


def shipped_models() -> list[str]:
    """Names of the shipped models, the default first."""
    from ..files.checkpoint import LAWS, shipped_networks

    return [LAWS, *shipped_networks()]


def configs(kind: str) -> Callable[[], list[str]]:
    """Find the names of the shipped YAML files in config/`kind`."""

    def find() -> list[str]:
        from ..files.config import config_folder

        return sorted(path.stem for path in (config_folder() / kind).glob('*.yaml'))

    return find


def chosen_command(commands: Iterable[str], line: str, point: int) -> str | None:
    """Return the command in a line that is being typed; None where it is not whole yet.

    Args:
        commands: All names.
        line: The line, with the name of the program.
        point: Where the cursor is.
    """
    words = line[:point].split()[1:]
    whole = words if line[:point].endswith(' ') else words[:-1]
    first = next((word for word in whole if not word.startswith('-')), None)
    return first if first in set(commands) else None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns completion`."""
    parser.add_argument('shell', choices=SHELLS, help='the shell that you type in')
    parser.epilog = (
        'example:\n'
        '  rigid-gns completion bash\n\n'
        'a line for the file that your shell reads when it starts:\n'
        '  ~/.bashrc                   eval "$(rigid-gns completion bash)"\n'
        '  ~/.zshrc, after compinit    eval "$(rigid-gns completion zsh)"\n'
        '  ~/.config/fish/config.fish  rigid-gns completion fish | source'
    )


def run(arguments: argparse.Namespace) -> int:
    """Print what the shell is to evaluate."""
    import argcomplete

    print(argcomplete.shellcode(['rigid-gns'], shell=arguments.shell))
    return 0
