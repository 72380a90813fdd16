"""Compile a kernel's parts only as far as the kernel needs them.

Numba makes of every compiled function, also of one that only other compiled functions call, a library of its own: a
wrapper for calls from Python, optimised in full, turned into machine code; and then puts the same code into each caller
and does all of that again, once for every level of calls. `PartCompiler` (a `pipeline_class` of `numba.njit`) leaves to
the kernel what only the kernel needs: a part has no wrapper, is simplified but not optimised, and becomes machine code
as part of its callers only. A part called from Python raises TypeError.

`WideCompiler` and `WidePartCompiler` compile a kernel over tiles of tracks, and its parts: their loops may fill the
processor's widest vectors. LLVM alone stays at half of 512 bits, which suits code with a vector now and then.
"""

from __future__ import annotations

from typing import Any

from llvmlite import binding as llvm
from llvmlite import ir
from numba._dynfunc import make_function
from numba.core import cgutils, compiler
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering

ALIKE = hash(compiler.Flags())  # Numba hashes the options' names, which are always the same


class Flags(compiler.Flags):
    """Numba's settings of one compilation, compared by what was set.

    Numba keys what it has found out about types by these too, and reads every option of both sides, by name and
    default, to tell whether they are equal: a tenth of the time that the tracker takes to compile.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> Any:
        return self._values == getattr(other, "_values", None) or super().__eq__(other)

    def __hash__(self) -> int:
        return ALIKE


class PartLibrary(JITCodeLibrary):
    """Code to be put into others: never optimised in full, never machine code, cached as bitcode."""

    refusal: ir.Module  # what Python calls

    def _optimize_final_module(self) -> None:
        made = self._codegen._module_pass_manager(
            loop_vectorize=self._codegen._loopvect, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        manager, *builder = made if isinstance(made, tuple) else (made,)  # a pair since Numba 0.62
        manager.run(self._final_module, *builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def serialize_using_object_code(self) -> Any:
        """Return what the cache keeps: the code to be put into others, and machine code of the refusal alone.

        A part that came from the cache as machine code would stand in for the same part in a kernel compiled after it:
        one function of that name is enough for the linker, and it would be this one, never optimised.
        """
        self._ensure_finalized()
        for variable in self._final_module.global_variables:  # Numba sets these, of the part and of its own parts, anew
            if variable.name.startswith("_ZN08NumbaEnv") and variable.name not in self.refusal.globals:
                environment = ir.GlobalVariable(self.refusal, cgutils.voidptr_t, variable.name)
                environment.linkage = "common"
                environment.initializer = cgutils.get_null_value(cgutils.voidptr_t)
        machine = self._codegen._tm.emit_object(llvm.parse_assembly(str(self.refusal)))
        return self.name, "object", (machine, self._get_module_for_linking().as_bitcode())


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Numba's last pass, for a part."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        context, flags = state.targetctx, state.flags
        state.library = library = PartLibrary(context.codegen(), state.func_id.func_qualname)
        library.enable_object_caching()
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
        super().run_pass(state)
        made, name = state["cr"], state.func_id.func_name
        library.refusal = _refuse_python(context, library, made.fndesc.llvm_cpython_wrapper_name, name)
        refusal = _refusal(context)
        entry = make_function(made.fndesc.lookup_module(), name, "part of a kernel", refusal, made.env, (library,))
        context.insert_user_function(entry, made.fndesc, [library])
        state["cr"] = made._replace(cfunc=entry)
        return True


class WideLower(Lower):
    """Lowering of one function that may use vectors of 512 bits, where there are any."""

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)
        set.add(self.function.attributes, '"prefer-vector-width"="512"')  # `add` alone knows no attributes with a value


@register_pass(mutates_CFG=True, analysis_only=False)
class WideLowering(NativeLowering):
    """Numba's last pass, for a kernel over tiles."""

    _name = "wide_lowering"
    lowering_class = WideLower


@register_pass(mutates_CFG=True, analysis_only=False)
class WidePartLowering(PartLowering):
    """Numba's last pass, for a part of such a kernel."""

    _name = "wide_part_lowering"
    lowering_class = WideLower


class PartCompiler(CompilerBase):
    """Numba's compiler with another pass in the place of its last."""

    lowering: type[NativeLowering] = PartLowering

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags = Flags(self.state.flags)

    def define_pipelines(self) -> list[Any]:
        """Return the one pipeline."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [
            (self.lowering, text) if kind is NativeLowering else (kind, text) for kind, text in pipeline.passes
        ]
        pipeline.finalize()
        return [pipeline]


class WidePartCompiler(PartCompiler):
    """For parts of kernels over tiles."""

    lowering = WidePartLowering


class WideCompiler(PartCompiler):
    """For kernels over tiles; they are called from Python as any other."""

    lowering = WideLowering


def _refuse_python(context: Any, library: Any, wrapper: str, name: str) -> ir.Module:
    """Give a library a wrapper for Python that does nothing but raise TypeError; return its module."""
    module = context.create_module("refusal")
    obj = ir.IntType(8).as_pointer()
    function = ir.Function(module, ir.FunctionType(obj, [obj, obj, obj]), wrapper)
    builder = ir.IRBuilder(function.append_basic_block())
    text = f"{name} is part of a kernel and cannot be called from Python"
    context.get_python_api(builder).err_set_string("PyExc_TypeError", text)
    builder.ret(cgutils.get_null_value(obj))
    library.add_ir_module(module)
    return module


_refusals: dict[Any, tuple[Any, int]] = {}


def _refusal(context: Any) -> int:
    """Return the address of one such wrapper, for the parts of this process, which have no machine code."""
    codegen = context.codegen()
    if codegen not in _refusals:
        library = codegen.create_library("refusal")
        _refuse_python(context, library, "boresight_part", "this")
        _refusals[codegen] = library, library.get_pointer_to_function("boresight_part")
    return _refusals[codegen][1]
