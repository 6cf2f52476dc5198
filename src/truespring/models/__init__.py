"""Models: a problem becomes a potential. Springs, FEM, and the moduli that springs realise."""

from typing import Protocol

from truespring.models.advice import model_warnings as model_warnings
from truespring.models.bem_springs import BemSprings as BemSprings
from truespring.models.biquadratic import BiquadraticSprings as BiquadraticSprings
from truespring.models.fem import ELEMENTS as ELEMENTS
from truespring.models.fem import Fem as Fem
from truespring.models.fem import FemPotential as FemPotential
from truespring.models.fem import FiniteElements as FiniteElements
from truespring.models.fitness import Fitness as Fitness
from truespring.models.fitness import follows_poisson as follows_poisson
from truespring.models.fitness import judge as judge
from truespring.models.given import GivenSprings as GivenSprings
from truespring.models.heml import Heml as Heml
from truespring.models.law import Constant as Constant
from truespring.models.law import Law as Law
from truespring.models.laws import LAWS as LAWS
from truespring.models.laws import material_constants as material_constants
from truespring.models.mass_tensor import MassTensor as MassTensor
from truespring.models.mechanism import refuse_mechanism as refuse_mechanism
from truespring.models.moduli import Moduli as Moduli
from truespring.models.moduli import moduli as moduli
from truespring.models.network import SpringNetwork as SpringNetwork
from truespring.models.rules import RULES as RULES
from truespring.models.rules import UserStiffness as UserStiffness
from truespring.models.springs import Springs as Springs
from truespring.models.springs import shared_springs as shared_springs
from truespring.models.summed import SummedElements as SummedElements
from truespring.models.terzopoulos import Terzopoulos as Terzopoulos
from truespring.models.volume import VolumeSprings as VolumeSprings
from truespring.models.volume import VolumeTerm as VolumeTerm
from truespring.potential import Potential
from truespring.problem import Problem

#: What may be solved, compared and exported as springs.
SpringModel = Springs | GivenSprings | SpringNetwork


class Model(Protocol):
    """How matter is idealised: what `solve` takes beside a bare potential."""

    @property
    def kind(self) -> str:
        """The word of the study file."""
        ...

    @property
    def label(self) -> str:
        """How curves and tables call the model."""
        ...

    def potential(self, problem: Problem) -> Potential:
        """Build the potential of the problem's body."""
        ...
