"""Refine the mesh of a study until the watched quantities settle."""

from truespring.converging.converge import converge as converge
from truespring.converging.result import StudyRefinement as StudyRefinement
from truespring.converging.settling import Refinement as Refinement
