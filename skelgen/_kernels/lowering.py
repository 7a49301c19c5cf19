"""How kernels become instructions of LLVM: as numba writes them, but fewer, which mean the same.

numba keeps each variable in a place of memory of its own, takes arrays apart wherever a number is read, and asks after
each call whether it failed; LLVM then removes all that again, which takes most of the time of compiling. This module
imports numba, which takes half a second, and is imported when the first kernel is compiled.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from llvmlite import ir as llvm  # type: ignore[import-untyped]
from numba.core import analysis, cgutils, ir, ir_utils, lowering, ssa, transforms, typed_passes, types, untyped_passes
from numba.core.compiler_machinery import PassManager, register_pass
from numba.np import arrayobj

_types: Any = types  # numba gives these no types, or half of them
_analysis: Any = analysis
_cgutils: Any = cgutils
_ir_utils: Any = ir_utils
_ssa: Any = ssa
_transforms: Any = transforms
_arrayobj: Any = arrayobj
_register: Any = register_pass
_builder_base: Any = llvm.IRBuilder
_manager_base: Any = PassManager
_lower_base: Any = lowering.Lower
_lowering_base: Any = typed_passes.NativeLowering
_flow_base: Any = untyped_passes.IRProcessing
_assignment_base: Any = untyped_passes.ReconstructSSA
_phis_base: Any = typed_passes.PreLowerStripPhis


class Passes(_manager_base):  # type: ignore[misc]
    """Steps of numba's compiler, without a check and a new analysis of all variables after each."""

    def _runPass(self, index: int, one: Any, state: Any) -> None:  # noqa: N802 - numba's name
        one.analysis = self._analysis
        one.run_initialization(state)
        one.run_pass(state)
        one.run_finalizer(state)


@_register(mutates_CFG=True, analysis_only=False)
class _Flow(_flow_base):  # type: ignore[misc]
    """Blocks that no branch reaches go."""

    _name = "skelgen_flow"

    def run_pass(self, state: Any) -> bool:
        state.func_ir.blocks = _transforms.canonicalize_cfg(state.func_ir.blocks)
        return True


@_register(mutates_CFG=True, analysis_only=False)
class _SingleAssignment(_assignment_base):  # type: ignore[misc]
    """Each value has a variable of its own."""

    _name = "skelgen_single_assignment"

    def run_pass(self, state: Any) -> bool:
        state.func_ir = _ssa.reconstruct_ssa(state.func_ir)
        state.func_ir._definitions = _ir_utils.build_definitions(state.func_ir.blocks)
        return True


@_register(mutates_CFG=True, analysis_only=False)
class _WithoutPhis(_phis_base):  # type: ignore[misc]
    """Where branches meet, a value is assigned before."""

    _name = "skelgen_without_phis"

    def run_pass(self, state: Any) -> bool:
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = _ir_utils.build_definitions(state.func_ir.blocks)
        return True


@_register(mutates_CFG=True, analysis_only=False)
class _Lowering(_lowering_base):  # type: ignore[misc]
    """Instructions are written."""

    _name = "skelgen_lowering"

    @property
    def lowering_class(self) -> Any:
        return _Lower


REPLACED: dict[Any, Any] = {
    untyped_passes.IRProcessing: _Flow,
    untyped_passes.ReconstructSSA: _SingleAssignment,
    typed_passes.PreLowerStripPhis: _WithoutPhis,
    typed_passes.NativeLowering: _Lowering,
}
"""Steps of numba's, and what takes their place where references are not counted."""


class _Lower(_lower_base):  # type: ignore[misc]
    """Writes instructions."""

    def setup_function(self, description: Any) -> None:
        super().setup_function(description)
        self.builder.__class__ = _Builder

    def _find_singly_assigned_variable(self) -> None:
        """Find the variables that need no place in memory: one assignment goes before each use."""
        super()._find_singly_assigned_variable()
        blocks = self.func_ir.blocks
        used = _analysis.compute_use_defs(blocks).usemap
        assigned = [(one.target.name, label) for label, block in blocks.items() for one in block.find_insts(ir.Assign)]
        times = Counter(name for name, _ in assigned)
        before = _analysis.compute_cfg_from_blocks(blocks).dominators()
        elsewhere: dict[str, set[int]] = {}
        for label, names in used.items():
            for name in names:
                elsewhere.setdefault(name, set()).add(label)
        self._singly_assigned_vars |= {
            name
            for name, at in assigned
            if times[name] == 1 and all(at < label and at in before[label] for label in elsewhere.get(name, ()))
        }

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Store a value: what was there before is not counted."""
        self._alloca_var(name, self.typeof(name))
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def lower_getitem(self, result: Any, expression: Any, value: Any, index: Any, signature: Any) -> Any:
        kind, index_kind = signature.args
        if not self._is_number(kind, index_kind):
            return super().lower_getitem(result, expression, value, index, signature)
        place = self._place(kind, self.loadvar(value.name), index, index_kind)
        number = _arrayobj.load_item(self.context, self.builder, kind, place)
        return self.context.cast(self.builder, number, signature.return_type, result)

    def lower_setitem(self, target: Any, index: Any, value: Any, signature: Any) -> Any:
        kind, index_kind, value_kind = signature.args
        if not self._is_number(kind, index_kind) or isinstance(value_kind, _types.Array):
            return super().lower_setitem(target, index, value, signature)
        place = self._place(kind, self.loadvar(target.name), index, index_kind)
        number = self.context.cast(self.builder, self.loadvar(value.name), self.typeof(value.name), kind.dtype)
        return _arrayobj.store_item(self.context, self.builder, kind, number, place)

    def _is_number(self, kind: Any, index_kind: Any) -> bool:
        """Whether an index is that of one number in an array whose numbers stand one after the other."""
        kinds = list(index_kind) if isinstance(index_kind, _types.BaseTuple) else [index_kind]
        return (
            not self.context.enable_boundscheck
            and isinstance(kind, _types.Array)
            and kind.layout == "C"
            and len(kinds) == kind.ndim
            and all(isinstance(one, _types.Integer) and one.signed for one in kinds)
        )

    def _place(self, kind: Any, array: Any, index: Any, index_kind: Any) -> Any:
        """Return where a number of an array is; indices below 0 count from the end."""
        build, model = self.builder, self.context.data_model_manager[kind]
        given = self.context.cast(build, self.loadvar(index.name), self.typeof(index.name), index_kind)
        is_tuple = isinstance(index_kind, _types.BaseTuple)
        place, step = None, None  # as numba adds and multiplies: otherwise LLVM takes less out of loops
        for axis, one in reversed(list(enumerate(index_kind if is_tuple else [index_kind]))):
            at = self.context.cast(build, build.extract_value(given, axis) if is_tuple else given, one, _types.intp)
            size = build.extract_value(array, [model.get_field_position("shape"), axis])
            if not (isinstance(at, llvm.Constant) and at.constant >= 0):
                at = build.select(build.icmp_signed("<", at, at.type(0)), build.add(at, size), at)
            moved = at if step is None else build.mul(at, step)
            place = moved if place is None else build.add(moved, place)
            step = size if step is None else build.mul(size, step)
        return build.gep(build.extract_value(array, model.get_field_position("data")), [place])

    def _lower_call_normal(self, function: Any, expression: Any, signature: Any) -> Any:
        is_part = isinstance(function, _types.Dispatcher) and function.dispatcher.targetoptions.get("_nrt") is False
        if not is_part or self.context.enable_boundscheck:
            return super()._lower_call_normal(function, expression, signature)
        build, convention = self.builder, self.context.call_conv  # a part raises nothing
        part = function.dispatcher.get_compile_result(signature)
        self.context.add_linking_libs((part.library,))
        given = self.fold_call_args(function, signature, expression.args, expression.vararg, expression.kws)
        packed = convention._get_arg_packer(part.fndesc.argtypes).as_arguments(build, given)
        result = _cgutils.alloca_once(build, convention.get_return_type(part.fndesc.restype).pointee)
        called = self.context.declare_function(build.module, part.fndesc)
        build.call(called, [result, build.function.args[1], *packed])
        return self.context.get_returned_value(build, part.fndesc.restype, build.load(result))

    def lower_expr(self, result: Any, expression: Any) -> Any:
        write = {"getiter": self._start, "iternext": self._next, "getattr": self._shape}.get(expression.op)
        written = write(expression) if write is not None else None
        return super().lower_expr(result, expression) if written is None else written

    def _shape(self, expression: Any) -> Any:
        """Return an array's shape."""
        kind = self.typeof(expression.value.name)
        if expression.attr != "shape" or not isinstance(kind, _types.Array):
            return None
        place = self.context.data_model_manager[kind].get_field_position("shape")
        return self.builder.extract_value(self.loadvar(expression.value.name), place)

    def _start(self, expression: Any) -> Any:
        """Begin a loop over a range that counts by one."""
        made = self.func_ir._definitions[expression.value.name]
        by_one = len(made) == 1 and getattr(made[0], "op", "") == "call" and len(made[0].args) < 3
        if not by_one or self.typeof(expression.value.name) is not _types.range_state64_type:
            return None
        build = self.builder
        start, stop, step = (build.extract_value(self.loadvar(expression.value.name), part) for part in range(3))
        at, left = _cgutils.alloca_once(build, start.type), _cgutils.alloca_once(build, start.type)
        build.store(start, at)
        build.store(build.sub(stop, start), left)
        return _cgutils.pack_struct(build, (at, stop, step, left))

    def _next(self, expression: Any) -> Any:
        """Take the next number of a range."""
        if self.typeof(expression.value.name) is not _types.range_iter64_type:
            return None
        build = self.builder
        at, _, step, left = (build.extract_value(self.loadvar(expression.value.name), part) for part in range(4))
        value, count = build.load(at), build.load(left)
        build.store(build.add(value, step), at)
        build.store(build.sub(count, count.type(1)), left)
        is_left = build.icmp_signed(">", count, count.type(0))
        return _cgutils.pack_struct(build, (value, is_left))


class _Builder(_builder_base):  # type: ignore[misc]
    """Adds instructions, but none that takes out of a struct what is seen to be put there."""

    def extract_value(self, struct: Any, place: Any, name: str = "") -> Any:
        path = list(place) if isinstance(place, tuple | list) else [place]
        while isinstance(struct, llvm.instructions.InsertValue):
            there = list(struct.indices)
            if path[: len(there)] == there:
                struct, path = struct.value, path[len(there) :]
                if not path:
                    return struct
            elif there[: len(path)] == path:
                break
            else:
                struct = struct.aggregate
        return super().extract_value(struct, path, name)
