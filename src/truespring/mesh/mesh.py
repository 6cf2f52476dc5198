"""The mesh: nodes, elements of one or several kinds, groups, and derived quantities."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import MeshError, nearest, shown
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.corners import Corners, corners_in_slices, determinants, squared_distance
from truespring.mesh.facets import facet_columns, facet_keys, facet_nodes, halved, n_facets
from truespring.mesh.forms import Forms, find_forms
from truespring.mesh.kinds import ELEMENT_KINDS, MIXED, ElementKind, Links
from truespring.mesh.merged import mixed_table, unmerged, width
from truespring.mesh.rows import ascending, distinct_rows

if TYPE_CHECKING:
    import pyvista
    from matplotlib.axes import Axes

# An element is degenerate where its corner Jacobian is below this share of its longest edge to the power of its
# dimension: elements a thousand times longer than wide, as shapes allow, are well above.
_DEGENERATE = 1e-9
# Share of the elements of a bounding box below which equal bricks have a stepped surface.
_FILLED = 0.99


_NONE: Mapping[str, Ints] = MappingProxyType({})


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Nodes and elements of one kind, or of several: see `of_kinds`.

    Attributes:
        nodes: undeformed positions [m], shape (n_nodes, dim).
        elements: node numbers, shape (n_elements, nodes of the kind). In a mesh of several kinds each is a
            quadrilateral or hexahedron, with corners repeated as in `ElementKind.merged`.
        element: the kind, a key of ELEMENT_KINDS; "line" in any dimension (networks, trusses); "mixed" for several.
        node_groups: node numbers by name, ascending; names for supports, loads and probes.
        element_groups: element numbers by name, ascending; names for regions of another material.
        facet_groups: facets by name, shape (n, 2): an element and the number of its facet in its kind's `facets`, in
            lexicographic order; names for loads, which act on these facets alone. A name that is no group of nodes
            becomes one: the facets' nodes.
        notes: remarks on the mesh, such as those of a reader.
        element_vectors: a vector for each element by name, such as directions of fibres, shape (n_elements, dim) or
            (n_elements, 3).
        middles: positions of the middle nodes of `edges` [m], shape (n_edges, dim), for triangles and tetrahedra of
            second order; None if all edges are straight. Elements of first order do not use them.

    Raises MeshError if arrays do not match, an element is inverted, degenerate or duplicate, or a node belongs to no
    element.

    Example:
        >>> import numpy as np
        >>> import truespring as ts
        >>> nodes = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
        >>> mesh = ts.Mesh(nodes, np.array([[0, 1, 2], [0, 2, 3]]), "triangle", node_groups={"foot": np.array([0, 1])})
        >>> mesh
        Mesh(4 nodes, 2 elements: triangle)
        >>> mesh.measures
        array([0.005, 0.005])
    """

    nodes: Floats
    elements: Ints
    element: str = "quadrilateral"
    node_groups: Mapping[str, Ints] = field(default_factory=dict)
    element_groups: Mapping[str, Ints] = field(default_factory=dict)
    facet_groups: Mapping[str, Ints] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    middles: Floats | None = None
    element_vectors: Mapping[str, Floats] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.element not in ELEMENT_KINDS and self.element != MIXED:
            allowed = ", ".join([*ELEMENT_KINDS, MIXED])
            raise MeshError(
                f"element = '{self.element}' is unknown{nearest(self.element, ELEMENT_KINDS)}; allowed: {allowed}"
            )
        try:
            object.__setattr__(self, "nodes", frozen_floats(self.nodes, (None, None), "nodes"))
            corners = width(self.dim) if self.element == MIXED else self.kind.n_nodes
            object.__setattr__(self, "elements", frozen_ints(self.elements, (None, None), "elements"))
        except ValueError as error:
            raise MeshError(str(error)) from None
        if self.elements.shape[1] != corners:
            raise MeshError(
                f"elements has shape {self.elements.shape}, expected (n, {corners}) for element = '{self.element}'"
                f"{_other_kinds(self.elements.shape[1], self.dim)}"
            )
        object.__setattr__(self, "element_groups", _groups(self.element_groups, len(self.elements), "element"))
        object.__setattr__(self, "element_vectors", self._element_vectors())
        object.__setattr__(self, "facet_groups", self._facet_groups())
        nodes = {name: np.unique(self.facet_nodes(facets)) for name, facets in self.facet_groups.items()}
        object.__setattr__(self, "node_groups", _groups({**nodes, **self.node_groups}, self.n_nodes, "node"))
        self._check()
        if self.middles is not None:
            object.__setattr__(self, "middles", self._checked_middles(self.middles))

    def __repr__(self) -> str:
        return f"Mesh({self.n_nodes} nodes, {len(self.elements)} elements: {self.kinds})"

    @classmethod
    def of_kinds(
        cls,
        nodes: Floats,
        cells: Mapping[str, Ints],
        node_groups: Mapping[str, Ints] = _NONE,
        element_groups: Mapping[str, Ints] = _NONE,
        facet_groups: Mapping[str, Ints] = _NONE,
        notes: tuple[str, ...] = (),
    ) -> "Mesh":
        """Return a mesh of elements of one kind or several.

        `cells` are node numbers by kind, keys of ELEMENT_KINDS, each of shape (n, nodes of the kind). Elements are
        numbered in the order of `cells`. Faces should match: two triangles on a quadrilateral share only its nodes, and
        displacements between these are not continuous.
        """
        there = {kind: elements for kind, elements in cells.items() if len(elements)}
        if len(there) == 1:
            ((kind, elements),) = there.items()
            return cls(nodes, elements, kind, node_groups, element_groups, facet_groups, notes)
        if not there:
            raise MeshError("a mesh without elements is empty")
        return cls(nodes, mixed_table(there), MIXED, node_groups, element_groups, facet_groups, notes)

    @classmethod
    def from_pyvista(cls, grid: "pyvista.DataSet", unit: str | float = "m", join: bool | None = None) -> "Mesh":
        """Return the mesh of a data set of PyVista, by the rules of `read_mesh` for VTK files.

        Args:
            grid: unstructured grid, image, structured grid or surface.
            unit: unit of its points, such as "mm"; a number is in metres.
            join: whether to merge coincident nodes; by default only if no two elements share a node.

        Boolean arrays become groups of their name, other integer arrays as in files; inverted elements are mirrored,
        nodes without an element left out, and the notes of the mesh say so.

        Raises MeshError if the grid contains no body.

        Example:
            >>> import pyvista
            >>> image = pyvista.ImageData(dimensions=(5, 3, 3), spacing=(10.0, 10.0, 10.0))
            >>> image.cell_data["soft"] = image.cell_centers().points[:, 0] > 20.0
            >>> organ = ts.Mesh.from_pyvista(image, unit="mm")
            >>> organ, [*organ.element_groups]
            (Mesh(45 nodes, 16 elements: hexahedron), ['soft'])
        """
        from truespring.showing.reading import mesh_of_pyvista

        return mesh_of_pyvista(grid, unit, join)

    @classmethod
    def from_meshio(cls, mesh: Any, unit: str | float = "m", join: bool | None = None) -> "Mesh":
        """Return the mesh of a `meshio.Mesh`, by the rules of `read_mesh`.

        Args:
            mesh: a mesh of meshio.
            unit: unit of its points, such as "mm"; a number is in metres.
            join: whether to merge coincident nodes; by default only if no two elements share a node.

        Point sets and cell sets become groups, and so do gmsh's physical groups and integer arrays, as in files;
        inverted elements are mirrored, nodes without an element left out, and the notes of the mesh say so.

        Raises MeshError if the mesh contains no body.

        Example:
            >>> import meshio
            >>> square = meshio.Mesh(1e3 * mesh.nodes, [("triangle", mesh.elements)], cell_sets={"half": [[1]]})
            >>> ts.Mesh.from_meshio(square, unit="mm").element_groups["half"]
            array([1])
        """
        from truespring.showing.reading import mesh_of_meshio

        return mesh_of_meshio(mesh, unit, join)

    def to_pyvista(self) -> "pyvista.UnstructuredGrid":
        """Return the mesh as a grid of PyVista [m], which `from_pyvista` reads back.

        Groups of nodes and elements are boolean arrays of their name. Groups of facets are integer arrays
        "facets:NAME", of which bit i is set if facet i of the element belongs to the group. Meshes with `middles` have
        cells of second order.

        Raises OutputError if PyVista is not installed.

        Example:
            >>> mesh.to_pyvista()["foot"].tolist()
            [True, True, False, False]
        """
        from truespring.showing.grids import mesh_grid

        return mesh_grid(self)

    def _repr_html_(self) -> str:
        """Return the mesh as HTML for a notebook: a table and a picture."""
        from truespring.showing.values import html_of

        return html_of(self)

    def plot(self, names: Sequence[str] | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the mesh by matplotlib, with named parts in colours.

        Data of the axes are in metres, numbers are written in a unit that fits. In space the body is an image.

        Args:
            names: groups, sides such as "left" or points such as "right-middle"; by default all groups (ten at most),
                or the sides of a mesh without groups.
            ax: axes to draw in; by default those of a new figure.

        Returns the axes. Raises MeshError for a name that matches no node.

        Example:
            >>> axes = mesh.plot(["foot", "top"])
        """
        from truespring.showing.meshes import plot_mesh

        return plot_mesh(self, names, ax)

    def _check(self) -> None:
        if not len(self.nodes) or not len(self.elements):
            raise MeshError(f"a mesh of {len(self.nodes)} nodes and {len(self.elements)} elements is empty")
        if self.element not in ("line", MIXED) and self.dim != self.kind.dim:
            raise MeshError(
                f"a {self.element} has {self.kind.dim} dimensions, the nodes have {self.dim}"
                f"{_other_kinds(self.elements.shape[1], self.dim)}"
            )
        if self.elements.min() < 0 or self.elements.max() >= len(self.nodes):
            raise MeshError(
                f"elements name nodes {self.elements.min()} to {self.elements.max()}, "
                f"there are 0 to {len(self.nodes) - 1}"
            )
        used = np.zeros(self.n_nodes, dtype=bool)
        used[self.elements] = True
        self._refuse(~used, "nodes", "unreferenced: no element has them", lambda: self.nodes)
        smallest, least = self._rest_jacobians.min(axis=1), self._degenerate
        inverted = smallest <= -least
        why = "inverted: their corner Jacobian is negative"
        if inverted.all():
            why += " (of a mirrored mesh, exchange two coordinates of its map, or reverse the node order)"
        self._refuse(inverted, "elements", why, lambda: self.centres)
        self._refuse(~(smallest > least), "elements", "degenerate: flat or with coincident nodes", lambda: self.centres)
        if self.element != "line":  # springs may be parallel
            twice = np.ones(len(self.elements), dtype=bool)
            for numbers, part in self.blocks:
                twice[numbers[distinct_rows(ascending(part.elements.T)).first]] = False
            self._refuse(twice, "elements", "duplicate: others have the same nodes", lambda: self.centres)

    def _checked_middles(self, middles: Floats) -> Floats:
        if self.element not in ("triangle", "tetrahedron"):
            raise MeshError(f"middles are supported for triangles and tetrahedra, not for {self.element} elements")
        try:
            frozen = frozen_floats(middles, (len(self.edges), self.dim), "middles")
        except ValueError as error:
            raise MeshError(str(error)) from None
        keys = self.edges[:, 0] * self.n_nodes + self.edges[:, 1]  # ascending, as edges are
        of_elements = np.searchsorted(keys, self.pair_keys(self.kind.edges).T)
        places = np.concatenate([self.nodes[self.elements], frozen[of_elements]], axis=1)
        shape = CELL_SHAPES["triangle6" if self.element == "triangle" else "tetra10"]
        folded = shape.smallest_jacobian(places) <= 0
        self._refuse(folded, "elements", "folded by their mid-edge nodes", lambda: self.centres)
        return frozen

    @property
    def _degenerate(self) -> Floats:
        """The corner Jacobian below which an element is degenerate [m^dim], shape (n_elements,)."""
        if self.element == MIXED:
            return self._by_block(lambda part: part._degenerate)
        longest = np.zeros(len(self.elements))
        if self.element != "line":
            for part, at in corners_in_slices(self.nodes, self.elements):
                longest[part] = np.maximum.reduce([squared_distance(at, *edge) for edge in self.kind.edges])
        return np.asarray(_DEGENERATE * longest ** (self.kind.dim / 2))

    def _refuse(self, bad: Bools, what: str, why: str, places: Callable[[], Floats]) -> None:
        """Raise MeshError with number, reason and first place if any entry of `bad` is true."""
        if bad.any():
            first = int(bad.argmax())
            place = ", ".join(f"{coordinate:.6g}" for coordinate in places()[first])
            raise MeshError(
                f"{int(bad.sum())} of {len(bad)} {what} are {why}; the first is {what[:-1]} {first} at ({place}) m"
            )

    def _element_vectors(self) -> Mapping[str, Floats]:
        """Freeze the vectors of elements; raise MeshError if a shape does not match."""
        frozen = {}
        for name, vectors in self.element_vectors.items():
            if np.shape(vectors) not in {(len(self.elements), self.dim), (len(self.elements), 3)}:
                raise MeshError(
                    f"vectors '{name}' of the elements have shape {np.shape(vectors)}: ({len(self.elements)}, "
                    f"{self.dim}) is expected"
                )
            frozen[name] = _frozen(np.array(vectors, dtype=np.float64))
        return MappingProxyType(frozen)

    def vectors_of(self, elements: Ints) -> dict[str, Floats]:
        """Return `element_vectors` of some elements, each of shape (n, dim) or (n, 3)."""
        return {name: vectors[elements] for name, vectors in self.element_vectors.items()}

    def _facet_groups(self) -> Mapping[str, Ints]:
        """Freeze groups of facets: each facet once; raise MeshError for one that is empty or does not exist."""
        frozen = {}
        for name, facets in self.facet_groups.items():
            given = np.asarray(facets)
            if given.ndim != 2 or given.shape[1:] != (2,) or not np.issubdtype(given.dtype, np.integer):
                raise MeshError(f"facet group '{name}' = {facets!r}: must have rows of element and local facet")
            there, last = n_facets(self.elements, self.element), len(self.elements) - 1
            beyond = not len(given) or (given < 0).any() or (given[:, 0] > last).any()
            if beyond or (given[:, 1] >= there[given[:, 0]]).any():
                raise MeshError(
                    f"facet group '{name}' is empty or has a facet that does not exist: elements are 0 to {last}, "
                    f"facets of each 0 to {there.max() - 1}"
                )
            members = np.unique(given.astype(np.int64), axis=0)
            members.setflags(write=False)
            frozen[name] = members
        return MappingProxyType(frozen)

    @property
    def kind(self) -> ElementKind:
        """The entry of ELEMENT_KINDS; raises MeshError for a mesh of several kinds."""
        if self.element == MIXED:
            raise MeshError(
                f"this needs elements of one kind, the mesh has {self.kinds} elements: springs and fem support several"
            )
        return ELEMENT_KINDS[self.element]

    @cached_property
    def blocks(self) -> tuple["Block", ...]:
        """The elements by kind."""
        if self.element != MIXED:
            return (Block(np.arange(len(self.elements)), self),)
        return tuple(
            Block(numbers, self._part(kind, own, numbers)) for kind, (numbers, own) in unmerged(self.elements).items()
        )

    @cached_property
    def is_stepped(self) -> bool:
        """Whether the mesh consists of equal hexahedra that do not fill their bounding box, as voxels do.

        The box has the directions of the edges of the elements. Of a `part`, it is that of the whole mesh.
        """
        if self.element != "hexahedron" or not self.forms.single:
            return False
        corners = self.nodes[self.elements[0]]
        edges = corners[[1, 3, 4]] - corners[0]
        counts = np.ptp(self.nodes @ np.linalg.inv(edges), axis=0)
        return bool(len(self.elements) < _FILLED * np.prod(counts))

    def part(self, numbers: Ints, nodes: Ints) -> "Mesh":
        """Return a mesh of some elements, without checks, groups and middle nodes.

        `numbers` are the elements, shape (n,), and `nodes` the distinct nodes of them, in the order of the new mesh.
        """
        place = np.zeros(self.n_nodes, dtype=np.int64)
        place[nodes] = np.arange(len(nodes))
        found = self._unchecked(self.nodes[nodes], place[self.elements[numbers]], self.element, numbers)
        if len(found.blocks) == 1:
            found = found.blocks[0].mesh
        found.__dict__["is_stepped"] = self.is_stepped
        return found

    def _part(self, kind: str, elements: Ints, numbers: Ints) -> "Mesh":
        """Return a mesh of some elements of one kind on all nodes, without checks; `numbers` are theirs in this one."""
        return self._unchecked(self.nodes, elements, kind, numbers)

    def _unchecked(self, nodes: Floats, elements: Ints, kind: str, numbers: Ints) -> "Mesh":
        """Return a mesh of the elements `numbers` of this one, without checks and groups."""
        part = object.__new__(Mesh)
        groups = dict.fromkeys(("node_groups", "element_groups", "facet_groups"), _NONE)
        vectors = MappingProxyType(self.vectors_of(numbers))
        own = {"nodes": nodes, "elements": elements, "element": kind, "notes": (), "element_vectors": vectors}
        part.__dict__.update(own, **groups)
        return part

    def _by_block(self, values: Callable[["Mesh"], Floats]) -> Floats:
        """Return values computed by kind, in the order of the elements, shape (n_elements,)."""
        found = np.empty(len(self.elements))
        for numbers, part in self.blocks:
            found[numbers] = values(part)
        return found

    @property
    def element_kinds(self) -> tuple[str, ...]:
        """Kinds of the elements, keys of ELEMENT_KINDS."""
        return (self.element,) if self.element != MIXED else tuple(part.element for _, part in self.blocks)

    @property
    def kinds(self) -> str:
        """Kind of the elements in words: "wedge", or of several kinds "8 hexahedron and 2 wedge"."""
        if self.element != MIXED:
            return self.element
        *some, last = (f"{len(numbers)} {part.element}" for numbers, part in self.blocks)
        return f"{', '.join(some)} and {last}" if some else last

    @property
    def cells(self) -> dict[str, Ints]:
        """Elements by key of CELL_SHAPES, shape (n, k) each, in the order of `blocks`."""
        return {part.kind.vtk: part.elements for _, part in self.blocks}

    @property
    def element_dim(self) -> int:
        """Dimension of the elements."""
        return self.dim if self.element == MIXED else self.kind.dim

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return int(self.nodes.shape[1])

    @property
    def n_nodes(self) -> int:
        """The number of nodes."""
        return len(self.nodes)

    @cached_property
    def lower(self) -> Floats:
        """The smallest coordinates [m], shape (dim,)."""
        return _frozen(np.array([column.min() for column in self.nodes.T]))

    @cached_property
    def upper(self) -> Floats:
        """The largest coordinates [m], shape (dim,)."""
        return _frozen(np.array([column.max() for column in self.nodes.T]))

    @property
    def diameter(self) -> float:
        """The diagonal of the bounding box [m]: the length that tolerances are relative to."""
        return float(np.linalg.norm(self.upper - self.lower))

    @property
    def centres(self) -> Floats:
        """The mean of each element's nodes [m], shape (n_elements, dim)."""
        return self.means(self.nodes)

    def means(self, values: Floats) -> Floats:
        """Return the means over elements, shape (n_elements, ...), of nodal values of shape (n_nodes, ...)."""
        total = np.zeros((len(self.elements), *values.shape[1:]))
        for numbers, part in self.blocks:
            own = np.zeros((len(numbers), *values.shape[1:]))
            for corner in part.elements.T:
                own += values[corner]
            own /= part.elements.shape[1]
            total[numbers] = own
        return total

    def pair_keys(self, pairs: Links) -> Ints:
        """Return a key for each local pair of nodes of each element, shape (pairs, n_elements).

        The key is the smaller node number times n_nodes plus the larger one.
        """
        keys = np.empty((len(pairs), len(self.elements)), dtype=np.int64)
        for key, (one, other) in zip(keys, pairs, strict=True):
            low, high = ascending((self.elements[:, one], self.elements[:, other]))
            np.multiply(low, self.n_nodes, out=key)
            key += high
        return keys

    @cached_property
    def edges(self) -> Ints:
        """Edges of the elements, each once, shape (n_edges, 2)."""
        keys = np.concatenate([part.pair_keys(part.kind.edges).ravel() for _, part in self.blocks])
        keys.sort(kind="stable")
        return np.stack(np.divmod(keys[np.diff(keys, prepend=-1) > 0], self.n_nodes), axis=1)

    @cached_property
    def facets(self) -> Ints:
        """Facets of the elements, each once, in the node order of one of its elements, shape (n_facets, k).

        In a table with quadrilaterals, triangles repeat their last corner.
        """
        return self.facets_of(self.elements)[0]

    @cached_property
    def boundary(self) -> Ints:
        """Facets that belong to one element only, in the node order of that element, shape (n, k).

        In a table with quadrilaterals, triangles repeat their last corner. A quadrilateral covered by two triangles of
        other elements, and these triangles, are not part of the boundary.
        """
        facets, alone = self.facets_of(self.elements)
        found = np.asarray(facets[alone])
        return found[~halved(found)] if self.element == MIXED and self.dim == 3 else found

    def facet_nodes(self, facets: Ints) -> Ints:
        """Return nodes of facets (see `facet_groups`), anticlockwise seen from outside, shape (n, k)."""
        return facet_nodes(self.elements, self.element, facets)

    def facets_of(self, elements: Ints, within: Bools | None = None) -> tuple[Ints, Bools]:
        """Return each facet of `elements` once, shape (n, k), and whether only one element has it, shape (n,).

        With `within`, shape (n_nodes,), return only the facets for whose nodes it is true.
        """
        facets = facet_columns(elements, self.element)
        if within is not None:
            facets = facets[:, within[facets].all(axis=0)]
        found = distinct_rows(facet_keys(facets))
        return np.ascontiguousarray(facets[:, found.first].T), np.asarray(found.count == 1)

    @cached_property
    def forms(self) -> Forms:
        """Elements of equal form: equal up to a translation."""
        return find_forms(self.nodes, self.elements)

    def _jacobians(self, at: Corners) -> Iterator[Floats]:
        """Yield the Jacobian at each corner of elements [m^dim], given node coordinates; for lines the length [m]."""
        if self.element == "line":
            yield np.sqrt(squared_distance(at, 0, 1))
        else:
            yield from determinants(at, self.kind.corners)

    def corner_jacobians(self, positions: Floats) -> Floats:
        """Return the Jacobian at each corner of each element [m^dim], shape (n_elements, corners).

        For lines it is the length. An element is inverted if one of its Jacobians is not positive. In a mesh of several
        kinds, the last value is repeated for elements with fewer corners.
        """
        if self.element == MIXED:
            most = max(len(block.kind.corners) for _, block in self.blocks)
            found = np.empty((len(self.elements), most))
            for numbers, block in self.blocks:
                own = block.corner_jacobians(positions)
                found[numbers] = own[:, np.minimum(np.arange(most), own.shape[1] - 1)]
            return found
        found = np.empty((len(self.elements), len(self.kind.corners) or 1))
        for part, at in corners_in_slices(positions, self.elements):
            for corner, jacobian in enumerate(self._jacobians(at)):
                found[part, corner] = jacobian
        return found

    def smallest_area_ratio(self, positions: Floats) -> float:
        """Return the smallest ratio of a deformed to an undeformed corner Jacobian.

        It is not positive if an element is inverted. In 3D it is a ratio of volumes. NaN if a position is NaN.
        """
        if self.element == MIXED:
            return float(np.min([part.smallest_area_ratio(positions) for _, part in self.blocks]))
        smallest = np.inf
        with np.errstate(over="ignore", invalid="ignore"):  # the state may have diverged
            for part, at in corners_in_slices(positions, self.elements):
                for jacobian, rest in zip(self._jacobians(at), self._rest_jacobians[part].T, strict=True):
                    smallest = np.minimum(smallest, (jacobian / rest).min())
        return float(smallest)

    @cached_property
    def _rest_jacobians(self) -> Floats:
        return self.corner_jacobians(self.nodes)

    @cached_property
    def measures(self) -> Floats:
        """Undeformed length, area or volume of each element [m^dim], shape (n_elements,)."""
        if self.element == "line":
            return np.asarray(self._rest_jacobians[:, 0])
        return self.measures_at(self.nodes)

    def measures_at(self, positions: Floats) -> Floats:
        """Return the signed area or volume of each element at `positions` [m^dim], shape (n_elements,); exact."""
        if self.element == MIXED:
            return self._by_block(lambda part: part.measures_at(positions))
        found = np.zeros(len(self.elements))
        for part, at in corners_in_slices(positions, self.elements):
            for determinant in determinants(at, self.kind.simplices):
                found[part] += determinant
        return found * (self.kind.simplex_weight / math.factorial(self.kind.dim))

    @cached_property
    def parts(self) -> Ints:
        """Number of the connected part of each node, from 0, shape (n_nodes,)."""
        corners = self.elements.astype(np.int32)
        ends = np.repeat(corners[:, 0], corners.shape[1] - 1), corners[:, 1:].ravel()
        graph = sparse.coo_array((np.ones(len(ends[0]), dtype=bool), ends), shape=(self.n_nodes, self.n_nodes))
        from scipy.sparse.csgraph import connected_components

        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


class Block(NamedTuple):
    """Elements of one kind: their numbers in the mesh, ascending, and a mesh of them on all nodes."""

    numbers: Ints
    mesh: Mesh


def _frozen(array: Floats) -> Floats:
    array.setflags(write=False)
    return array


def _other_kinds(n_nodes: int, dim: int) -> str:
    """Return the kinds of so many nodes and dimensions as the end of a message, empty if there are none."""
    names = [name for name, kind in ELEMENT_KINDS.items() if (kind.n_nodes, kind.dim) == (n_nodes, dim)]
    return "".join(f"; use element = '{name}'" for name in names)


def _groups(groups: Mapping[str, Ints], n_there: int, what: str) -> Mapping[str, Ints]:
    """Freeze groups: numbers ascending and each once; raise MeshError for one that is empty or does not exist."""
    frozen = {}
    for name, numbers in groups.items():
        given = np.asarray(numbers)
        if given.ndim != 1 or not np.issubdtype(given.dtype, np.integer):
            instead = ", such as np.flatnonzero(mask)" if given.dtype == bool else ""
            raise MeshError(f"{what} group '{name}' = {shown(numbers)}: must be a list of {what} numbers{instead}")
        members = np.unique(given.astype(np.int64))
        if not members.size or members[0] < 0 or members[-1] >= n_there:
            raise MeshError(f"{what} group '{name}' is empty or has a number that no {what} has: 0 to {n_there - 1}")
        members.setflags(write=False)
        frozen[name] = members
    return MappingProxyType(frozen)
