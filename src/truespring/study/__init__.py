"""Study files: read, checked, run."""

from truespring.study.read import Study as Study
from truespring.study.read import read_study as read_study
from truespring.study.run import plan as plan
from truespring.study.run import read_studies as read_studies
from truespring.study.run import realised_moduli as realised_moduli
from truespring.study.run import run as run
from truespring.study.run import write as write
from truespring.study.run import write_overview as write_overview
