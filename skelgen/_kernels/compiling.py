"""How kernels are compiled: as numba does it, but for what they do not need.

What a kernel calls becomes machine code within it only: numba would optimise each part and each function of its own by
themselves and make machine code of them, which nobody calls. For numbers of arrays, loops over ranges, and calls of
parts fewer instructions are written, which mean the same: numba spends most of its time on what it removes again.

All this rests on numba's internals, to which it gives no types.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterator
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils, codegen, compiler, lowering, typed_passes, types, untyped_passes
from numba.core.compiler_machinery import register_pass
from numba.np import arrayobj

_UNNEEDED = (  # as no part has closures, branches on types, or expressions of whole arrays
    untyped_passes.InlineClosureLikes,
    untyped_passes.DeadBranchPrune,
    untyped_passes.MakeFunctionToJitFunction,
    untyped_passes.InlineInlinables,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
)
# numba gives these no types, or half of them.
_types: Any = types
_cgutils: Any = cgutils
_arrayobj: Any = arrayobj
_register: Any = register_pass
_compiler: Any = compiler.Compiler
_library: Any = codegen.JITCodeLibrary
_lower: Any = lowering.Lower
_lowering: Any = typed_passes.NativeLowering


class KernelCompiler(_compiler):  # type: ignore[misc]
    """numba's compiler for a kernel, with all that it calls."""

    announce: Callable[[str], None]

    def _compile_core(self) -> Any:
        make = self.state.targetctx.codegen()
        if "create_library" not in vars(make):  # else another kernel calls this one
            self.announce(self.state.func_id.func_name)
        self.state.library = type(make).create_library(make, self.state.func_id.func_qualname)
        self.state.library.enable_object_caching()
        with _only_parts(make):
            return super()._compile_core()

    def define_pipelines(self) -> Any:
        return [_changed(passes, ()) for passes in super().define_pipelines()]


class PartCompiler(_compiler):  # type: ignore[misc]
    """The same for what only kernels call."""

    def define_pipelines(self) -> Any:
        return [_changed(passes, _UNNEEDED) for passes in super().define_pipelines()]


@contextlib.contextmanager
def _only_parts(make: Any) -> Iterator[None]:
    """Compile all else as parts, which numba's own functions are too, and collect no garbage: most objects stay."""
    if "create_library" in vars(make):
        yield
        return
    collects = gc.isenabled()
    gc.disable()
    make.create_library = lambda name: _PartLibrary(make, name)
    try:
        yield
    finally:
        del make.create_library
        if collects:
            gc.enable()


class _PartLibrary(_library):  # type: ignore[misc]
    """Code that is linked into that of a kernel."""

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


def _changed(passes: Any, unneeded: tuple[type, ...]) -> Any:
    """Leave passes of numba's out of a pipeline, and write instructions by `_Lower`."""
    left = type(passes)(passes.pipeline_name)
    for one, name in passes.passes:
        if one not in unneeded:
            left.passes.append((_Lowering if one is typed_passes.NativeLowering else one, name))
    left.finalize()
    return left


class _Lower(_lower):  # type: ignore[misc]
    """Writes instructions."""

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        kind, index_kind = signature.args
        if not _is_number(kind, index_kind):
            return super().lower_getitem(resty, expr, value, index, signature)
        place = self._place(kind, self.loadvar(value.name), index, index_kind)
        number = _arrayobj.load_item(self.context, self.builder, kind, place)
        return self.context.cast(self.builder, number, kind.dtype, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        kind, index_kind, _ = signature.args
        if not _is_number(kind, index_kind):
            return super().lower_setitem(target_var, index_var, value_var, signature)
        place = self._place(kind, self.loadvar(target_var.name), index_var, index_kind)
        value = self.loadvar(value_var.name)
        number = self.context.cast(self.builder, value, self.typeof(value_var.name), kind.dtype)
        return _arrayobj.store_item(self.context, self.builder, kind, number, place)

    def _place(self, kind: Any, array: Any, index: Any, index_kind: Any) -> Any:
        """Where a number of an array is; indices below 0 count from the end."""
        build, model = self.builder, self.context.data_model_manager[kind]
        cast = self.context.cast(build, self.loadvar(index.name), self.typeof(index.name), index_kind)
        kinds = list(index_kind) if isinstance(index_kind, _types.BaseTuple) else [index_kind]
        sizes = _extracted(build, array, model.get_field_position("shape"))
        place = None
        for axis, one in enumerate(kinds):
            at = _extracted(build, cast, axis) if isinstance(index_kind, _types.BaseTuple) else cast
            at = self.context.cast(build, at, one, _types.intp)
            size = _extracted(build, sizes, axis)
            if not (isinstance(at, ir.Constant) and at.constant >= 0):
                at = build.select(build.icmp_signed("<", at, at.type(0)), build.add(at, size), at)
            place = at if place is None else build.add(build.mul(place, size), at)
        return build.gep(_extracted(build, array, model.get_field_position("data")), [place])

    def delvar(self, name: str) -> None:
        model = self.context.data_model_manager[self.typeof(name)]
        if self.context.enable_nrt and model.contains_nrt_meminfo():  # else nothing is counted
            super().delvar(name)

    def _lower_call_normal(self, fnty: Any, expr: Any, signature: Any) -> Any:
        if not (isinstance(fnty, _types.Dispatcher) and fnty.dispatcher.targetoptions.get("_nrt") is False):
            return super()._lower_call_normal(fnty, expr, signature)
        build, conv = self.builder, self.context.call_conv  # a part raises nothing
        part = fnty.dispatcher.get_compile_result(signature)
        self.context.add_linking_libs((part.library,))
        args = self.fold_call_args(fnty, signature, expr.args, expr.vararg, expr.kws)
        packed = conv._get_arg_packer(part.fndesc.argtypes).as_arguments(build, args)
        result = _cgutils.alloca_once(build, conv.get_return_type(part.fndesc.restype).pointee)
        function = self.context.declare_function(build.module, part.fndesc)
        build.call(function, [result, build.function.args[1], *packed])
        return self.context.get_returned_value(build, part.fndesc.restype, build.load(result))

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        build, op = self.builder, expr.op
        kind = self.typeof(expr.value.name) if op in ("getiter", "iternext", "pair_first", "pair_second") else None
        if op == "getiter" and kind is _types.range_state64_type and self._counts_by_one(expr.value):
            start, stop, step = (_extracted(build, self.loadvar(expr.value.name), part) for part in range(3))
            at, left = _cgutils.alloca_once(build, start.type), _cgutils.alloca_once(build, start.type)
            build.store(start, at)
            build.store(build.sub(stop, start), left)
            return _cgutils.pack_struct(build, (at, stop, step, left))
        if op == "iternext" and kind is _types.range_iter64_type:
            at, _, step, left = (_extracted(build, self.loadvar(expr.value.name), part) for part in range(4))
            value, count = build.load(at), build.load(left)
            build.store(build.add(value, step), at)
            build.store(build.sub(count, count.type(1)), left)
            return _cgutils.pack_struct(build, (value, build.icmp_signed(">", count, count.type(0))))
        if kind is not None and isinstance(kind, _types.Pair) and kind.first_type is _types.intp:
            return _extracted(build, self.loadvar(expr.value.name), 0 if op == "pair_first" else 1)
        return super().lower_expr(resty, expr)

    def _counts_by_one(self, value: Any) -> bool:
        """Whether a range has no third argument."""
        made = self.func_ir._definitions[value.name]
        return len(made) == 1 and getattr(made[0], "op", "") == "call" and len(made[0].args) < 3


@_register(mutates_CFG=True, analysis_only=False)
class _Lowering(_lowering):  # type: ignore[misc]
    """Numba's step with the same name."""

    @property
    def lowering_class(self) -> Any:
        return _Lower


def _extracted(build: Any, struct: Any, place: int) -> Any:
    """A member of a struct: what was put there, if that is seen."""
    inner = struct
    while isinstance(inner, ir.instructions.InsertValue):
        if inner.indices == [place]:
            return inner.operands[1]
        inner = inner.operands[0]
    return build.extract_value(struct, place)


def _is_number(kind: Any, index_kind: Any) -> bool:
    """Whether an index is that of one number in an array whose numbers stand one after the other."""
    kinds = list(index_kind) if isinstance(index_kind, _types.BaseTuple) else [index_kind]
    return (
        isinstance(kind, _types.Array)
        and kind.layout == "C"
        and len(kinds) == kind.ndim
        and all(isinstance(one, _types.Integer) and one.signed for one in kinds)
    )
