"""An export target: springs.csv, a row for each plain spring."""

from truespring.exports import Exported, Target
from truespring.exports.features import Feature


def csv(exported: Exported) -> dict[str, str]:
    """Return springs.csv: the two nodes, stiffness [N/m] and rest length [m] of each spring."""
    network = exported.network
    rows = zip(network.springs.tolist(), network.stiffness.tolist(), network.rest_length.tolist(), strict=True)
    lines = [f"{a},{b},{stiffness!r},{rest!r}" for (a, b), stiffness, rest in rows]
    return {"springs.csv": "\n".join(["a,b,stiffness [N/m],rest length [m]", *lines, ""])}


CSV = Target(
    csv,
    "springs.csv, a row for each spring",
    "CSV",
    ("springs.csv",),
    frozenset({Feature.PRESTRESS, Feature.NEGATIVE}),
    expressed="Each spring is a row: its nodes, stiffness and rest length.",
    left_out="Nodes, supports and loads are left out.",
    unrun="a table is not run",
)
