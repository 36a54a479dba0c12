# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links what an entry calls into it before anything is optimized, and optimizes the whole once.

Numba optimizes a function with all that it calls, makes machine code of it, and does so again
within each of its callers: a function ten calls deep eleven times. Here only an entry, which
Python calls, is optimized. All else in it is its own, so that LLVM may drop arguments that a
function does not use, and there are hundreds where tuples of arrays are given: the code is
faster, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
import importlib
from typing import Any

import llvmlite.binding as llvm
from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import codegen, compiler, typed_passes
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment


class _Part(codegen.JITCodeLibrary):
    """Code of one function, neither linked nor optimized.

    `key` names it: module and name of the function, types of its arguments, and its symbol, which
    is another where another process compiled it.
    """

    key: tuple[Any, ...] = ()

    def finalize(self) -> None:
        """Nothing is to be done before an entry links it."""
        self._finalized = True

    @cached_property
    def alone(self) -> Any:
        """Module of this function without those that it calls."""
        return _mergeable(self._final_module)

    def below(self) -> Iterator[Any]:
        """Modules of all that it calls, each once."""
        found, seen = list(self._linking_libraries), set()
        for library in found:  # grows
            if library not in seen:
                seen.add(library)
                is_part = isinstance(library, _Part)
                yield library.alone if is_part else library._get_module_for_linking()
                found += library._linking_libraries if is_part else ()

    def _get_module_for_linking(self) -> Any:
        """The whole, for functions that are compiled by Numba's own compiler."""
        if self._shared_module is None:
            self._shared_module = _linked(self.alone.clone(), self.below())
        return self._shared_module

    def serialize_using_object_code(self) -> tuple[Any, ...]:
        """For a file: this function, what Numba compiled for it, and names of other parts."""
        libraries = dict.fromkeys(self._linking_libraries)
        parts = [library.key for library in libraries if isinstance(library, _Part)]
        others = (
            library._get_module_for_linking()
            for library in libraries
            if not isinstance(library, _Part)
        )
        return self.name, 'part', (_linked(self.alone.clone(), others).as_bitcode(), parts)


class _Entry(_Part):
    """Code of an entry with all that it calls; other entries link it as they link a part."""

    def finalize(self) -> None:
        """Link, optimize and make machine code."""
        self._raise_if_finalized()
        module, own = self._final_module, {part.name for part in _defined(self.alone)}
        _linked(module, self.below())
        for function in _defined(module):
            if function.name not in own:
                # not internal: MCJIT would take such a function for others of its name
                function.linkage = 'private'
        self._optimize_final_module()
        module.verify()
        self._finalize_final_module()
        for variable in module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                self.codegen.set_env(variable.name, environment)

    def serialize_using_object_code(self) -> tuple[Any, ...]:
        """For a file: machine code, and the whole module for what links it from there."""
        whole = _mergeable(self._final_module).as_bitcode()
        return self.name, 'object', (self._get_compiled_object(), whole)


def rebuilt(target: Any, libdata: Any, fndesc: Any, environment: Any, *rest: Any) -> Any:
    """Result of a compilation from what its `_reduce` gave, which was in a file.

    None where a part that it calls is not the one that it was compiled with.
    """
    name, kind, content = libdata
    if kind != 'part':
        result: Any = compiler.CompileResult
        return result._rebuild(target, libdata, fndesc, environment, *rest)
    signature, objectmode, lifted, annotation, reload_init, environments = rest
    code, parts = content
    library = _Part(target.codegen(), name)
    library._final_module = llvm.parse_bitcode(code)
    library._linking_libraries = [_library_of(*key) for key in parts]
    if None in library._linking_libraries:
        return None
    library.key = _key(fndesc)
    library.finalize()
    return compiler.compile_result(
        typing_context=target.typing_context,
        target_context=target,
        entry_point=_stand_in(library, fndesc, environment),
        type_annotation=annotation,
        library=library,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        fndesc=fndesc,
        environment=environment,
        reload_init=reload_init,
        referenced_envs=environments,
    )


def _key(fndesc: Any) -> tuple[Any, ...]:
    return fndesc.modname, fndesc.qualname, tuple(fndesc.argtypes), fndesc.mangled_name


def _library_of(module: str, name: str, arguments: Any, symbol: str) -> Any:
    """Library of a part from its file; None where it is another one by now."""
    dispatcher = getattr(importlib.import_module(module), name)
    dispatcher.compile(arguments)
    made = dispatcher.overloads[arguments]
    return made.library if made.fndesc.mangled_name == symbol else None


def _stand_in(library: Any, fndesc: Any, environment: Any) -> Any:
    """What Numba knows a part by: an object that Python could call, were there code behind."""
    module, name = fndesc.lookup_module(), fndesc.qualname
    return _dynfunc.make_function(module, name, '', 0, environment, (library,))


def _linked(module: Any, others: Iterable[Any]) -> Any:
    """The module, with others in it; in pairs, since a link looks through all it goes into."""
    parts = [_kept(other.clone()) for other in others]
    while len(parts) > 1:
        for one, other in zip(parts[::2], parts[1::2], strict=False):
            one.link_in(other)
        parts = parts[::2]
    for part in parts:
        module.link_in(part)
    return module


def _kept(module: Any) -> Any:
    """Let a module keep what it defines, though what calls it is in another one."""
    for function in _defined(module):
        if function.linkage in (llvm.Linkage.linkonce_any, llvm.Linkage.linkonce_odr):
            function.linkage = 'weak_odr'
    return module


def _defined(module: Any) -> list[Any]:
    return [function for function in module.functions if not function.is_declaration]


def _mergeable(module: Any) -> Any:
    """Copy of a module that several may link."""
    copy = module.clone()
    for function in _defined(copy):
        if function.linkage == llvm.Linkage.external:
            function.linkage = 'linkonce_odr'
    return copy


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerPart(typed_passes.NativeLowering):
    _name = 'part_lowering'

    def run_pass(self, state: Any) -> bool:
        """Make code of a function that other compiled functions can call."""
        library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library, state.flags.no_compile = library, True
        super().run_pass(state)  # type: ignore[no-untyped-call]
        made = state['cr']
        library.key = _key(made.fndesc)
        stand_in = _stand_in(library, made.fndesc, made.env)
        state.targetctx.insert_user_function(stand_in, made.fndesc, [library])
        state['cr'] = made._replace(cfunc=stand_in)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _LowerEntry(typed_passes.NativeLowering):
    _name = 'entry_lowering'

    def run_pass(self, state: Any) -> bool:
        """Make code of a function that Python can call."""
        state.library = _Entry(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        super().run_pass(state)  # type: ignore[no-untyped-call]
        state.library.key = _key(state['cr'].fndesc)
        return True


class PartCompiler(compiler.CompilerBase):
    """Numba's compiler of a function that only compiled functions call."""

    _lowering: Any = _LowerPart

    def define_pipelines(self) -> list[Any]:
        """Numba's passes, but for the last but one."""
        passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (self._lowering if one is typed_passes.NativeLowering else one, why)
            for one, why in passes.passes
        ]
        passes.finalize()
        return [passes]


class EntryCompiler(PartCompiler):
    """Numba's compiler of a function that Python calls."""

    _lowering = _LowerEntry
