"""Natural frequencies and shapes of small vibrations, of springs and finite elements beside each other."""

from truespring.vibration.beside import StudyModes as StudyModes
from truespring.vibration.pairing import Pair as Pair
from truespring.vibration.pairing import assurance as assurance
from truespring.vibration.pairing import like as like
from truespring.vibration.pairing import pairs as pairs
from truespring.vibration.result import Modes as Modes
from truespring.vibration.solving import modes as modes
from truespring.vibration.study import study_modes as study_modes
