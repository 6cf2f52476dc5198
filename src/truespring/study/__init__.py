"""Study files: read, check and run them, and write their results."""

from truespring.study.changes import value_at as value_at
from truespring.study.export import export_study as export_study
from truespring.study.export import refused_targets as refused_targets
from truespring.study.export import springs_of as springs_of
from truespring.study.last_level import require_last_level as require_last_level
from truespring.study.moduli import Realised as Realised
from truespring.study.moduli import realised_moduli as realised_moduli
from truespring.study.moduli import realised_values as realised_values
from truespring.study.moduli import rule_values as rule_values
from truespring.study.moduli import write_moduli as write_moduli
from truespring.study.network import read_network as read_network
from truespring.study.plan import plan as plan
from truespring.study.read import Study as Study
from truespring.study.read import StudyText as StudyText
from truespring.study.read import read_study as read_study
from truespring.study.read import read_text as read_text
from truespring.study.run import Known as Known
from truespring.study.run import run as run
from truespring.study.several import read_studies as read_studies
from truespring.study.writing import output as output
from truespring.study.writing import verify_command as verify_command
from truespring.study.writing import write as write
from truespring.study.writing import write_model as write_model
from truespring.study.writing import write_overview as write_overview
from truespring.study.writing import write_rest as write_rest
