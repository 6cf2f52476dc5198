"""Keys of `[mesh]`: one class for each form, which builds the mesh."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import reduce
from operator import or_
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Discriminator, Field, Tag

from truespring.errors import StudyError
from truespring.mesh import Mesh, box, read_mesh, read_voxels, rectangle, refined, refuse_too_large
from truespring.models import SpringNetwork
from truespring.study.network import read_network
from truespring.study.places import Places
from truespring.study.schema.values import (
    Count,
    Diagonal,
    FileName,
    Keys,
    Length,
    PlaneElement,
    SolidElement,
    three,
    two,
)
from truespring.units import unit_size


class MeshKeys(Keys):
    """A body's mesh."""

    def finer(self, halvings: int) -> Self:
        """Return the keys with the element size halved `halvings` times, if keys state numbers of elements."""
        return self

    @abstractmethod
    def build(self, places: Places, halvings: int) -> Mesh | SpringNetwork:
        """Return the mesh, or the network with its mesh; refine it `halvings` times unless `finer` did."""


class ShapeKeys(MeshKeys):
    """A shape that truespring meshes; a subclass has the keys `shape`, `size`, `elements` and `element`.

    Attributes:
        is_bar: whether it is a rectangle or box with a corner at the origin, for which maps have standard loads.
    """

    is_bar: ClassVar[bool] = False
    if TYPE_CHECKING:  # each with limits and a description in the subclass
        shape: Any
        size: list[float]
        elements: list[int]
        element: Any

    @abstractmethod
    def divided(self, counts: Sequence[int]) -> Mesh:
        """Return the mesh with `counts` elements along each direction."""

    def finer(self, halvings: int) -> Self:
        """Return the keys with the numbers of elements doubled `halvings` times."""
        return self.model_copy(update={"elements": [count * 2**halvings for count in self.elements]})

    def build(self, places: Places, halvings: int) -> Mesh:
        """Return the mesh."""
        return self.divided(self.elements)


class RectangleKeys(ShapeKeys):
    """A rectangle, divided into elements."""

    is_bar: ClassVar[bool] = True

    shape: Literal["rectangle"] = Field(description="a rectangle with a corner at the origin")
    size: Annotated[list[Length], two] = Field(description="lengths along x and y")
    elements: Annotated[list[Count], two] = Field(description="numbers of elements along x and y")
    element: PlaneElement = Field(default="quadrilateral", description="kind of elements")
    diagonal: Diagonal = Field(default="right", description="how triangles split each rectangle")

    def divided(self, counts: Sequence[int]) -> Mesh:
        """Return the mesh of the rectangle with `counts` elements along x and y."""
        return rectangle(self.size, counts, self.element, self.diagonal)


class BoxKeys(ShapeKeys):
    """A box, divided into elements."""

    is_bar: ClassVar[bool] = True

    shape: Literal["box"] = Field(description="a box with a corner at the origin")
    size: Annotated[list[Length], three] = Field(description="lengths along x, y and z")
    elements: Annotated[list[Count], three] = Field(description="numbers of elements along x, y and z")
    element: SolidElement = Field(default="hexahedron", description="kind of elements")

    def divided(self, counts: Sequence[int]) -> Mesh:
        """Return the mesh of the box with `counts` elements along x, y and z."""
        return box(self.size, counts, self.element)


class FileKeys(MeshKeys):
    """A mesh from a file, with the length unit of the file."""

    file: FileName = Field(
        description="mesh file, relative to the study: gmsh .msh, Abaqus or CalculiX .inp, VTK .vtk and .vtu"
    )
    unit: str = Field(default="m", description='length unit of the file, such as "mm", which mesh files do not state')
    join: bool | None = Field(
        default=None,
        description="whether coincident nodes are merged; default: only if no two elements share a node",
    )

    def build(self, places: Places, halvings: int) -> Mesh:
        """Read the mesh and refine it."""
        with places.at("mesh", "unit"):
            unit_size(self.unit, "length")
        with places.at("mesh", "file"):
            mesh = read_mesh(places.beside(self.file), self.unit, self.join)
            refuse_too_large(mesh.n_nodes, mesh.dim)
            return _halved(mesh, halvings)


class VoxelsKeys(MeshKeys):
    """A body from a label image: each voxel of the label is a hexahedron."""

    voxels: FileName = Field(description="label image, relative to the study: .nii, .nrrd, .mha, .vti or .npy")
    label: int | str = Field(description="label of the body in the image: its value, or its name if the file has names")
    edge: Length | None = Field(
        default=None, description="edge of the cubes to which the image is resampled; default: the voxels of the image"
    )
    unit: str = Field(default="mm", description="length unit of the image")

    def build(self, places: Places, halvings: int) -> Mesh:
        """Read the image, mesh the label and refine the mesh."""
        with places.at("mesh", "unit"):
            unit_size(self.unit, "length")
        with places.at("mesh", "voxels"):
            file = self.voxels if self.voxels.startswith("pyvista:") else places.beside(self.voxels)
            return _halved(read_voxels(file, self.label, self.edge, self.unit), halvings)


class NetworkFilesKeys(MeshKeys):
    """A spring network from two CSV files, for the model of kind "network"."""

    nodes: FileName = Field(
        description="CSV file of nodes, relative to the study: columns x, y and, in 3D, z [m], for a motion mass [kg]"
    )
    springs: FileName = Field(
        description="CSV file of springs, relative to the study: columns a, b, stiffness [N/m], rest_length [m]"
    )

    def build(self, places: Places, halvings: int) -> SpringNetwork:
        """Read the network; raise StudyError if it is to be refined."""
        if halvings:
            raise StudyError("a network cannot be refined")
        return read_network(places.beside(self.nodes), places.beside(self.springs))


def _halved(mesh: Mesh, times: int) -> Mesh:
    """Return the mesh with the element size halved `times` times; raise MeshError if it does not fit in memory."""
    for _ in range(times):
        refuse_too_large(2**mesh.dim * mesh.n_nodes, mesh.dim)
        mesh = refined(mesh)
    return mesh


#: The forms of `[mesh]` by the value of `shape` or, for those without a shape, by a key that only they have.
MESH_FORMS: Mapping[str, type[MeshKeys]] = MappingProxyType(
    {
        "rectangle": RectangleKeys,
        "box": BoxKeys,
        "file": FileKeys,
        "voxels": VoxelsKeys,
        "springs": NetworkFilesKeys,
    }
)
#: The values of `shape`.
SHAPES = tuple(name for name, form in MESH_FORMS.items() if issubclass(form, ShapeKeys))


def _form_of(value: Any) -> str | None:
    """Return the key in MESH_FORMS for the value of `mesh`, None if that is not a table."""
    if not isinstance(value, dict):
        return None
    named = (form for form in MESH_FORMS if form not in SHAPES and form in value)
    return next(named, str(value.get("shape")))


if TYPE_CHECKING:
    AnyMesh = MeshKeys
else:
    _tagged = (Annotated[form, Tag(name)] for name, form in MESH_FORMS.items())
    AnyMesh = Annotated[reduce(or_, _tagged), Discriminator(_form_of)]
