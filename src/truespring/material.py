"""Material and section of a body: its elastic constants, and plane stress, plane strain or a solid."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar, NamedTuple, Self

from truespring.errors import ProblemError
from truespring.fibres import Fibres

_MODULI = {"mu": "shear", "bulk": "bulk"}


class Lame(NamedTuple):
    """Lamé constants [Pa]."""

    lam: float
    mu: float


#: Density of water [kg/m^3], for bodies that move and have none.
WATER = 1000.0


@dataclass(frozen=True, slots=True)
class Material:
    """An isotropic elastic material.

    Attributes:
        young: Young's modulus [Pa], positive.
        poisson: Poisson's ratio [-], between -1 and 0.5, both excluded.
        density: [kg/m^3], positive; None if unknown.
        constants: further constants of constitutive laws by name [SI], as a mapping or pairs, stored as sorted pairs.
            The entries of LAWS define them; a law ignores the constants of other laws.
        fibres: fibres whose energy is added to that of the law; None without.

    Example:
        >>> import truespring as ts
        >>> ts.Material(young=10e3, poisson=0.45, density=1000.0).density
        1000.0
        >>> ts.Material(young=10e3, poisson=0.45, constants={"jm": 30.0}).constants
        (('jm', 30.0),)
    """

    young: float
    poisson: float
    density: float | None = None
    constants: Mapping[str, float] | Sequence[tuple[str, float]] = field(default=())
    fibres: Fibres | None = None

    def __post_init__(self) -> None:
        if self.fibres is not None and not isinstance(self.fibres, Fibres):
            raise ProblemError(f"fibres = {self.fibres!r}: give Fibres(along=..., k1=..., k2=...)")
        object.__setattr__(self, "constants", tuple(sorted(dict(self.constants).items())))
        for name, value in dict(self.constants).items():
            if not math.isfinite(value):
                raise ProblemError(f"{name} = {value!r}: must be finite")
        if not (math.isfinite(self.young) and self.young > 0):
            raise ProblemError(f"young = {self.young!r} Pa: Young's modulus must be positive and finite")
        if not -1 < self.poisson < 0.5:
            raise ProblemError(
                f"poisson = {self.poisson!r}: Poisson's ratio must be between -1 and 0.5, both excluded; "
                "use 0.49 for a nearly incompressible material"
            )
        if self.density is not None and not (math.isfinite(self.density) and self.density > 0):
            raise ProblemError(f"density = {self.density!r} kg/m^3: the density must be positive and finite")

    @classmethod
    def from_moduli(
        cls,
        mu: float,
        bulk: float,
        density: float | None = None,
        constants: Mapping[str, float] | Sequence[tuple[str, float]] = (),
        fibres: Fibres | None = None,
    ) -> Self:
        """Return the material of a shear modulus and a bulk modulus at small strain [Pa], both positive.

        young = 9 bulk mu / (3 bulk + mu) and poisson = (3 bulk - 2 mu) / (2 (3 bulk + mu)).
        """
        for name, value in (("mu", mu), ("bulk", bulk)):
            if not (math.isfinite(value) and value > 0):
                raise ProblemError(f"{name} = {value!r} Pa: the {_MODULI[name]} modulus must be positive and finite")
        ratio = bulk / mu
        return cls(9 * bulk / (3 * ratio + 1), (3 * ratio - 2) / (2 * (3 * ratio + 1)), density, constants, fibres)

    @property
    def lame(self) -> Lame:
        """Lamé constants of the material in 3D [Pa]."""
        young, poisson = self.young, self.poisson
        return Lame(young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson)))


@dataclass(frozen=True, slots=True)
class Section(ABC):
    """The assumption about the third direction of a plane body; `thickness` [m], 1 for a solid.

    Attributes:
        key: value of `kind` in `[section]`; empty for a body in 3D.
        dim: dimension of the bodies.
        free_thickness: whether the thickness changes freely, so that the stress across the plane is zero.
        moduli_words: formulas of the apparent moduli; empty if they are those of the material.
        elements: prefix of the element names in CalculiX and Abaqus, before the number of nodes.
    """

    thickness: float
    key: ClassVar[str] = ""
    dim: ClassVar[int] = 2
    free_thickness: ClassVar[bool] = False
    moduli_words: ClassVar[str] = ""
    elements: ClassVar[str] = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.thickness) and self.thickness > 0):
            raise ProblemError(f"thickness = {self.thickness!r} m: the thickness must be positive and finite")

    @abstractmethod
    def apparent_moduli(self, material: Material) -> tuple[float, float]:
        """Return Young's modulus [Pa] and Poisson's ratio [-] measured in a tension test in the plane of the mesh."""

    def lame_within(self, material: Material) -> Lame:
        """Return the Lamé constants of Hooke's law in the plane of the mesh [Pa]."""
        return material.lame

    @property
    def words(self) -> str:
        """Name in sentences: "plane stress"; empty for a body in 3D."""
        return self.key.replace("-", " ")

    @property
    def within(self) -> str:
        """The words " in plane strain" if the apparent moduli differ from those of the material, else ""."""
        return f" in {self.words}" if self.moduli_words else ""


@dataclass(frozen=True, slots=True)
class PlaneStress(Section):
    """A thin body that changes its thickness freely.

    Example:
        >>> import truespring as ts
        >>> ts.PlaneStress(thickness=0.01).apparent_moduli(ts.Material(young=10e3, poisson=0.3))
        (10000.0, 0.3)
    """

    key: ClassVar[str] = "plane-stress"
    free_thickness: ClassVar[bool] = True
    elements: ClassVar[str] = "CPS"

    def apparent_moduli(self, material: Material) -> tuple[float, float]:
        """Return the moduli of the material [Pa], [-]."""
        return material.young, material.poisson

    def lame_within(self, material: Material) -> Lame:
        """Return 2 lam mu / (lam + 2 mu) and mu [Pa]."""
        lam, mu = material.lame
        return Lame(2 * lam * mu / (lam + 2 * mu), mu)


@dataclass(frozen=True, slots=True)
class PlaneStrain(Section):
    """A slice of a long body, of constant thickness.

    Example:
        >>> import truespring as ts
        >>> young, poisson = ts.PlaneStrain(thickness=0.01).apparent_moduli(ts.Material(young=10e3, poisson=0.3))
        >>> round(young, 1), round(poisson, 4)  # E / (1 - nu^2), nu / (1 - nu)
        (10989.0, 0.4286)
    """

    key: ClassVar[str] = "plane-strain"
    moduli_words: ClassVar[str] = "E / (1 - nu^2) and nu / (1 - nu)"
    elements: ClassVar[str] = "CPE"

    def apparent_moduli(self, material: Material) -> tuple[float, float]:
        """Return E / (1 - nu^2) [Pa] and nu / (1 - nu) [-]."""
        return material.young / (1 - material.poisson**2), material.poisson / (1 - material.poisson)


@dataclass(frozen=True, slots=True)
class Solid(Section):
    """A body in 3D: the default section of a Problem in 3D."""

    thickness: float = 1.0
    dim: ClassVar[int] = 3
    elements: ClassVar[str] = "C3D"

    def apparent_moduli(self, material: Material) -> tuple[float, float]:
        """Return the moduli of the material [Pa], [-]."""
        return material.young, material.poisson


#: Sections of plane bodies by `kind` in `[section]`.
SECTIONS: Mapping[str, type[Section]] = MappingProxyType({one.key: one for one in (PlaneStress, PlaneStrain)})
