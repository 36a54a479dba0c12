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

"""`rigid-gns completion`: completion for a shell."""

from __future__ import annotations

import argparse
from collections.abc import Iterable

SHELLS = ('bash', 'zsh', 'fish')


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
