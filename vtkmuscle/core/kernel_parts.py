"""Kernels that other kernels call: compiled as parts of these, and not to the end.

Numba makes machine code of every function that a compiled one calls, and an entry for Python, and then puts
a copy of its instructions into each caller, where they are optimised again. A function at the bottom of four
was thereby optimised and translated four times. A part is typed and written as instructions for LLVM once,
and simplified; it is optimised, and machine code made, with the kernel that Python calls.

Numba's documented way to do so is a pipeline of one's own: ``numba.njit(pipeline_class=...)``. It leaves out
what kernels have no use for, of numba's steps and of LLVM's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba import _dynfunc
from numba.core import compiler, typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_machinery import PassManager, register_pass

from vtkmuscle.core.call_types import call_types_remembered

#: Steps of numba's for what kernels do not have: functions within functions, ``inline="always"``, and
#: expressions of arrays.
_LEFT_OUT = (
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.LiteralUnroll,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
    typed_passes.DumpParforDiagnostics,
)


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The machine code of a kernel whose sums are taken as written: LLVM optimises it once.

    Numba has it done three times, which its vector instructions are the better for: function by function,
    with few steps, with all.
    """

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        steps, builder = self._codegen._module_pass_manager()
        steps.run(self._final_module, builder)


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(typed_passes.NativeLowering):  # type: ignore[misc]
    """Writes a kernel's instructions, and makes its machine code."""

    _name = "kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        """Write and make them."""
        if not state.flags.fastmath:
            state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()  # so that it can be kept on disk
        done: bool = super().run_pass(state)
        return done


class PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The instructions of a part, for the kernels that call it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(typed_passes.NativeLowering):  # type: ignore[misc]
    """Writes a part's instructions."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Write them, and tell numba where callers find them."""
        name = state.func_id.func_qualname
        state.library = PartLibrary(state.targetctx.codegen(), name)
        state.flags.no_compile, state.flags.no_cpython_wrapper = True, True
        super().run_pass(state)
        lowered = state.cr
        # Numba finds a function's instructions by its entry for Python, which this one is in name only.
        module, kept = lowered.fndesc.lookup_module(), (state.library,)
        entry = _dynfunc.make_function(module, name, "Part of kernels.", 0, lowered.env, kept)
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state.cr = lowered._replace(cfunc=entry)
        return True


class KernelCompiler(compiler.CompilerBase):  # type: ignore[misc]
    """Numba's compiler for kernels that Python calls."""

    lowering: type = KernelLowering

    def compile_extra(self, func: Callable[..., object]) -> Any:
        """Compile a function."""
        with call_types_remembered():
            return super().compile_extra(func)

    def define_pipelines(self) -> list[Any]:
        """Return numba's steps without those that kernels do not need."""
        steps = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        native = typed_passes.NativeLowering
        steps.passes = [
            (self.lowering if step is native else step, words)
            for step, words in steps.passes
            if step not in _LEFT_OUT
        ]
        return [_finalised(steps)]


class PartCompiler(KernelCompiler):
    """Numba's compiler for kernels that kernels call: the same steps; the last one makes no machine code."""

    lowering = PartLowering


def _finalised(steps: PassManager) -> PassManager:
    steps._finalized = False
    steps.finalize()
    return steps


def part_of_kernels(function: Callable[..., object], **options: Any) -> Any:
    """Return a function compiled for kernels that call it; Python cannot.

    Parameters
    ----------
    function : callable
        Of plain arrays and numbers.
    **options
        Of :func:`numba.njit`.
    """
    return numba.njit(pipeline_class=PartCompiler, **options)(function)
