"""Convert the surfaces of a deck, *SURFACE, to facets of the body.

Source: "Element-based surface definition" in the manual of Abaqus, and *SURFACE in that of CalculiX CrunchiX.
"""

import re
from functools import cached_property

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.files.contents import places
from truespring.mesh.files.inp_assembly import Assembly, Placed
from truespring.mesh.files.inp_elements import dimension, facets_of_kind, is_shell, local_facet
from truespring.mesh.files.inp_scopes import Elements, Surface, SurfaceRow

_NO_FACETS = np.zeros((0, 2), dtype=np.int64)

# The two sides of a shell; CalculiX numbers them 1 and 2, and the edges from 3.
_SIDES = ("SNEG", "SPOS", "S1", "S2")


class Surfaces:
    """Finds the facets of surfaces."""

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self._dim = max((dimension(block.kind) for block in assembly.cells), default=0)

    def facets(self, owner: Placed, surface: Surface) -> Ints:
        """Return (element number, local facet), shape (n, 2); raise MeshError if a face is not a facet of the body."""
        if surface.unread:
            raise MeshError(surface.unread)
        return np.concatenate([_NO_FACETS, *(self.row(owner, row) for row in surface.rows)])

    def row(self, owner: Placed, row: SurfaceRow) -> Ints:
        """Return the facets of one data line of a surface, as (element number, local facet), shape (n, 2)."""
        named = self._assembly.named(owner, row.on, "ELSET") if row.on.name else self._assembly.all_elements(owner)
        found = [_NO_FACETS]
        for block in self._assembly.cells:
            which = np.isin(block.numbers, named)
            if which.any():
                part = block._replace(numbers=block.numbers[which], nodes=block.nodes[which])
                found.append(self._faces(part, row.label))
        return np.concatenate(found)

    def _faces(self, block: Elements, label: str) -> Ints:
        dim = dimension(block.kind)
        if dim == self._dim:
            return self._own_faces(block, label)
        if dim == self._dim - 1 and (label in ("", *_SIDES) if dim == 2 else not label):
            return self._covered(block)
        raise MeshError(f"{label or 'the surface'} of {block.type} is no facet of the body")

    def _own_faces(self, block: Elements, label: str) -> Ints:
        """Return the labelled faces of elements of the body; without a label, those that no other element shares."""
        if not label:
            owners, _, count = self._all
            return np.asarray(owners[np.isin(owners[:, 0], block.numbers) & (count == 1)])
        face = re.fullmatch(r"[SE]([1-9])", label)
        number = int(face[1]) if face else 0
        if is_shell(block.type):  # a plane body: its edges
            number = 0 if label in _SIDES else number - 2 if label[0] == "S" else number
        local = local_facet(block.kind, number)
        if local is None:
            raise MeshError(f"{label[:20]} of {block.type} is no facet of the body")
        return np.stack([block.numbers, np.full(len(block.numbers), local)], axis=1)

    def _covered(self, block: Elements) -> Ints:
        """Return the facets of the body that coincide with the given shell elements."""
        owners, nodes, _ = self._all
        corners = np.full((len(block.numbers), 4), -1)
        width = 3 if block.kind == "triangle" else 4 if block.kind == "quadrilateral" else 2
        corners[:, :width] = block.nodes[:, :width]
        both = np.unique(np.concatenate([nodes, np.sort(corners, axis=1)]), axis=0, return_inverse=True)[1].ravel()
        rows = places(both[: len(nodes)], both[len(nodes) :])
        if (rows < 0).any():
            raise MeshError(f"{(rows < 0).sum()} of its {block.type} are on no facet of the body")
        return owners[rows]

    @cached_property
    def _all(self) -> tuple[Ints, Ints, Ints]:
        """Return all facets of all elements: (element, local facet), sorted corners, number of elements that share it.

        Shapes (n, 2), (n, 4) with -1 for missing corners, and (n,).
        """
        owners, nodes = [_NO_FACETS], [np.zeros((0, 4), dtype=np.int64)]
        for block in self._assembly.cells:
            for local, corners in enumerate(facets_of_kind(block.kind) if dimension(block.kind) == self._dim else ()):
                at = np.full((len(block.numbers), 4), -1)
                at[:, : len(corners)] = block.nodes[:, corners]
                owners.append(np.stack([block.numbers, np.full(len(at), local)], axis=1))
                nodes.append(np.sort(at, axis=1))
        every = np.concatenate(nodes)
        back, count = np.unique(every, axis=0, return_inverse=True, return_counts=True)[1:]
        return np.concatenate(owners), every, count[back.ravel()]
