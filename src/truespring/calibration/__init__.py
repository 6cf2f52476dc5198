"""Calibration: fit the stiffness of springs to references, and test them on loads held out."""

from truespring.calibration.calibration import REGULARISATION as REGULARISATION
from truespring.calibration.calibration import calibrate as calibrate
from truespring.calibration.cases import LoadCase as LoadCase
from truespring.calibration.cases import Observation as Observation
from truespring.calibration.cases import require_one_body as require_one_body
from truespring.calibration.curve import Curve as Curve
from truespring.calibration.curve import read_curve as read_curve
from truespring.calibration.fitted import CaseResult as CaseResult
from truespring.calibration.identifiability import Identifiability as Identifiability
from truespring.calibration.identifiability import identifiability as identifiability
from truespring.calibration.kinds import UNKNOWNS as UNKNOWNS
from truespring.calibration.kinds import make_unknowns as make_unknowns
from truespring.calibration.objective import Objective as Objective
from truespring.calibration.result import Calibration as Calibration
from truespring.calibration.turned import turned as turned
from truespring.calibration.unknowns import Unknowns as Unknowns
