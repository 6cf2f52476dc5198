"""The nodes at which two results are compared."""

from truespring.report.result import Result
from truespring.report.verdict.naming import display_name


def carrying_sentence(result: Result) -> str | None:
    """Return at which nodes two results are compared; None for a study, whose models share their nodes."""
    if not result.in_detail or result.model is None:
        return None
    ((name, one),) = result.comparisons.items()
    mesh = one.model.problem.mesh
    model, reference = display_name(result, result.model), display_name(result, name)
    if not one.model.states or not one.reference.states:
        alone = reference if not one.reference.states else model
        return f"{alone} holds a deformed surface only, so surfaces are compared."
    if one.node_by_node:
        return f"Both have the same {mesh.n_nodes:,} nodes and are compared node by node."
    at_reference = one.reference.problem is one.known_on[1].problem
    carried, to = (model, reference) if at_reference else (reference, model)
    left = f"; {one.n_outside:,} nodes outside of it are left out" if one.n_outside else ""
    return f"{carried} is interpolated in its elements to the {mesh.n_nodes:,} nodes of {to}{left}."
