"""A study and its calibrated springs."""

from dataclasses import dataclass

from truespring.calibration.result import Calibration
from truespring.study.read import Study


@dataclass(frozen=True, eq=False)
class FittedStudy:
    """A study whose springs were calibrated.

    Attributes:
        study: the study of springs and mesh.
        springs: name of the springs in the study.
        reference: name of the model, or names of the files, that the springs were fitted to.
        calibration: the fitted springs.
    """

    study: Study
    springs: str
    reference: str
    calibration: Calibration
