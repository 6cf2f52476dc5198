"""Results of other programs, read as solutions."""

from truespring.reference.calculix import CalculiX as CalculiX
from truespring.reference.placing import Placing as Placing
from truespring.reference.placing import placed as placed
from truespring.reference.record import Level as Level
from truespring.reference.record import Record as Record
from truespring.reference.result import READERS as READERS
from truespring.reference.result import format_of as format_of
from truespring.reference.result import read_record as read_record
from truespring.reference.result import read_result as read_result
from truespring.reference.stl import read_shell as read_shell
from truespring.reference.stl import read_stl as read_stl
