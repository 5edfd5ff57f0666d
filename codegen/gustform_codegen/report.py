"""The model report: what a linked system consists of and what flattening made of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import numpy as np

from gustform_codegen.link import Linked

_ROUNDING = 1e-12  # of the largest value: what solving for a spline's coefficients costs, and no reason to warn


@dataclass(frozen=True)
class TypeReport:
    """One unit type: what was declared and what is left for the solver."""

    name: str
    instances: int
    declared_equations: int
    aliases: int
    substituted: int
    states: int
    iteration_variables: int
    nonzeros: int
    parameters: int
    zero_crossings: int
    when_clauses: int


@dataclass(frozen=True)
class ModelReport:
    """The whole system. `structure` is a sentence: the check raises an error when the system is not regular."""

    types: list[TypeReport]
    instances: int
    unknowns: int
    equations: int
    states: int
    connection_unknowns: int
    nonzeros: int
    inputs: int
    series: int
    scheduled_changes: int
    structure: str
    warnings: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, object]:
        return asdict(self)


def model_report(linked: Linked) -> ModelReport:
    """The report of a linked system; structure was checked when it was linked."""
    types = [
        TypeReport(
            name=t.unit.name,
            instances=len(t.names),
            declared_equations=t.unit.declared_equations,
            aliases=len(t.unit.aliases),
            substituted=t.unit.substituted,
            states=t.unit.n_states,
            iteration_variables=len(t.unit.unknowns) - t.unit.n_states,
            nonzeros=len(t.kernel.jacobian_row),
            parameters=len(t.unit.parameters),
            zero_crossings=len(t.unit.roots),
            when_clauses=len(t.unit.whens),
        )
        for t in linked.types
    ]
    warnings = []
    seen: set[int] = set()
    for t in linked.types:
        for name, component in zip(t.names, t.components, strict=True):
            for reference in t.unit.tables:
                data = component.at(reference.owner.path).table(reference.declaration.name)
                if id(data) not in seen and data.resampling_error > _ROUNDING * float(np.max(np.abs(data.value))):
                    seen.add(id(data))
                    path = ".".join(p for p in (name, reference.owner.path, reference.declaration.name) if p)
                    warnings.append(
                        f"{path}: table {data.name} differs from its uniform spline by at most "
                        f"{data.resampling_error:.2g} at the given points"
                    )
    table = linked.table
    return ModelReport(
        types=types,
        instances=table.n_instances,
        unknowns=table.n_unknowns,
        equations=table.n_unknowns,
        states=int(table.differential.sum()),
        connection_unknowns=len(linked.shared_names),
        nonzeros=int(table.row_index.size),
        inputs=int(table.input_value.size),
        series=len(table.series),
        scheduled_changes=int(table.schedule_time.size),
        structure="square and structurally regular, index 1",
        warnings=warnings,
    )
