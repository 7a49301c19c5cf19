"""How numba compiles kernels in less time: without what our kernels do not need.

This rests on numba's internals, which change: pyproject.toml allows the versions from 0.65, the oldest that the tests
of kernels are run with, to 0.68, the newest.
"""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def remembering_compiler() -> Any:
    """Return numba's compiler, but that it remembers the types that operators and functions give.

    For each ``+`` numba would go through some fifty rules, most of them of other things than numbers, when it infers
    types and again when it writes code: a sixth of all.
    """
    from numba.core import compiler, registry, types  # noqa: PLC0415 - half a second
    from numba.core.errors import TypingError  # noqa: PLC0415 - half a second
    from numba.extending import models, register_model  # noqa: PLC0415 - half a second

    compiler_base: Any = compiler.Compiler  # numba gives these no types
    context_base: Any = type(registry.cpu_target.typing_context)
    function_base: Any = types.Function

    class RememberingFunction(function_base):  # type: ignore[misc]
        def __init__(self, templates: Any) -> None:
            super().__init__(templates)
            self.known: dict[Any, Any] = {}

        def get_call_type(self, context: Any, arguments: Any, named: Any) -> Any:
            if named:
                return super().get_call_type(context, arguments, named)
            if arguments not in self.known:
                try:
                    self.known[arguments] = super().get_call_type(context, arguments, named)
                except TypingError as error:
                    self.known[arguments] = error
            known = self.known[arguments]
            if isinstance(known, TypingError):
                raise known.with_traceback(None)
            return known

        def augment(self, other: Any) -> Any:
            return function_base(self.templates).augment(other)

    register_model(RememberingFunction)(models.OpaqueModel)
    remembering: dict[Any, Any] = {}

    class RememberingContext(context_base):  # type: ignore[misc]
        def __init__(self, context: Any) -> None:
            self.__dict__ = context.__dict__  # all that the context of numba knows and learns

        def _lookup_global(self, value: Any) -> Any:
            found = super()._lookup_global(value)
            if type(found) is not function_base:
                return found
            if found not in remembering:
                remembering[found] = RememberingFunction(found.templates)
            return remembering[found]

    context = RememberingContext(registry.cpu_target.typing_context)

    class RememberingCompiler(compiler_base):  # type: ignore[misc]
        def __init__(self, typing_context: Any, target_context: Any, *others: Any) -> None:
            super().__init__(context, target_context.subtarget(typing_context=context), *others)

    return RememberingCompiler


@cache
def _kernel_library() -> Any:
    """Return what becomes machine code: LLVM optimises it once, as a whole, with all parts.

    numba would optimise each function by itself before, and those that a module only names, as those of Python, too.
    Here variables become values, which makes what is linked into several kernels small.
    """
    from llvmlite import binding  # type: ignore[import-untyped]  # noqa: PLC0415 - half a second with numba
    from numba.core import codegen  # noqa: PLC0415 - half a second

    library_base: Any = codegen.JITCodeLibrary  # numba gives it no types

    class KernelLibrary(library_base):  # type: ignore[misc]
        def _optimize_functions(self, module: Any) -> None:
            module.data_layout = self._codegen._data_layout
            passes, builder = binding.create_new_function_pass_manager(), self._codegen._pass_builder()
            passes.add_sroa_pass()
            for function in module.functions:
                if not function.is_declaration:
                    passes.run(function, builder)

        def _optimize_final_module(self) -> None:
            passes, builder = self._codegen._module_pass_manager()
            passes.run(self._final_module, builder)

    return KernelLibrary


@cache
def _part_library() -> Any:
    """Return what is no machine code yet: a part becomes that within its kernel only.

    numba would optimise each part and make machine code of it, which nobody calls, before it does so for the kernel
    that the part is linked into.
    """

    class PartLibrary(_kernel_library()):  # type: ignore[misc]
        def finalize(self) -> None:
            for library in dict.fromkeys(self._linking_libraries):
                self._reload_init.update(library._reload_init)
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
            self._finalize_dynamic_globals()
            self._finalized = True

        def get_pointer_to_function(self, name: str) -> int:
            self._ensure_finalized()
            return 0  # as numba says of what has no entry from Python

        @property
        def codegen(self) -> Any:
            return self

        def set_env(self, name: str, environment: object) -> None:
            """Do nothing: only what Python calls looks into its environment."""

    return PartLibrary


@cache
def plain_compiler() -> Any:
    """Return numba's compiler without the passes for closures, branches on types, and expressions of whole arrays.

    Where no arrays are made it does not look for the last use of each variable either: there numba would count
    references to arrays.
    """
    from numba.core import typed_passes, untyped_passes  # noqa: PLC0415 - half a second

    from skelgen._kernels import lowering  # noqa: PLC0415 - imports numba

    unneeded = (
        untyped_passes.WithLifting,
        untyped_passes.InlineClosureLikes,
        untyped_passes.RewriteSemanticConstants,
        untyped_passes.DeadBranchPrune,
        untyped_passes.RewriteDynamicRaises,
        untyped_passes.MakeFunctionToJitFunction,
        untyped_passes.InlineInlinables,
        untyped_passes.FindLiterallyCalls,
        untyped_passes.LiteralUnroll,
        untyped_passes.LiteralPropagationSubPipelinePass,
        typed_passes.InlineOverloads,
        typed_passes.NopythonRewrites,
        typed_passes.NoPythonSupportedFeatureValidation,
    )
    last_uses = typed_passes.IRLegalization

    class PlainCompiler(remembering_compiler()):  # type: ignore[misc]
        library_class = _kernel_library()

        def __init__(self, typing_context: Any, target_context: Any, *others: Any) -> None:
            super().__init__(typing_context, target_context, *others)
            self.state.targetctx.__class__ = _plain_context()  # of a copy that was made for this function

        def define_pipelines(self) -> Any:
            if self.state.library is None:
                codegen = self.state.targetctx.codegen()
                self.state.library = self.library_class(codegen, self.state.func_id.func_qualname)
                self.state.library.enable_object_caching()
            counts = self.state.flags.nrt
            left_out = unneeded if counts else (*unneeded, last_uses)
            replaced = {} if counts else lowering.REPLACED
            return [_changed(passes, left_out, replaced) for passes in super().define_pipelines()]

    return PlainCompiler


@cache
def _plain_context() -> Any:
    """Return numba's target context, but that it knows at once that no array stands in for another, and keeps sizes.

    numba would look for a function that gives the array behind each array that is read, and read all its registries
    again as there is none; and have LLVM compile a module to learn how many bytes a number takes.
    """
    from numba.core import registry  # noqa: PLC0415 - half a second

    context_base: Any = type(registry.cpu_target.target_context)
    sizes: dict[Any, int] = {}
    alignments: dict[Any, int] = {}

    class PlainContext(context_base):  # type: ignore[misc]
        def get_function(self, function: Any, signature: Any, **others: Any) -> Any:
            if isinstance(function, str) and function == "__array__":
                raise NotImplementedError
            return super().get_function(function, signature, **others)

        def get_abi_sizeof(self, kind: Any) -> int:
            if kind not in sizes:
                sizes[kind] = super().get_abi_sizeof(kind)
            return sizes[kind]

        def get_abi_alignment(self, kind: Any) -> int:
            if kind not in alignments:
                alignments[kind] = super().get_abi_alignment(kind)
            return alignments[kind]

    return PlainContext


@cache
def part_compiler() -> Any:
    """Return numba's compiler for parts of kernels."""

    class PartCompiler(plain_compiler()):  # type: ignore[misc]
        library_class = _part_library()

    return PartCompiler


def _changed(passes: Any, unneeded: tuple[type, ...], replaced: dict[Any, Any]) -> Any:
    """Leave passes of numba's out of a pipeline, and replace others."""
    from skelgen._kernels import lowering  # noqa: PLC0415 - imports numba

    left = lowering.Passes(passes.pipeline_name) if replaced else type(passes)(passes.pipeline_name)
    left.passes.extend((replaced.get(one, one), name) for one, name in passes.passes if one not in unneeded)
    left.finalize()
    return left
