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

"""What argcomplete offers, when a shell asks, for the words of an option."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable


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
    """Names of the shipped models."""
    from .checkpoint import WEIGHTS_FOLDER

    return sorted(path.stem for path in WEIGHTS_FOLDER.glob('*.safetensors'))


def configs(kind: str) -> Callable[[], list[str]]:
    """Find the names of the shipped YAML files in config/`kind`."""

    def find() -> list[str]:
        from .config import config_folder

        return sorted(path.stem for path in (config_folder() / kind).glob('*.yaml'))

    return find
