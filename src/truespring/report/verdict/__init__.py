"""The verdict on a result: how far a model may be trusted, in sentences made from numbers."""

from truespring.report.verdict.bending import mesh_sentence as mesh_sentence
from truespring.report.verdict.carrying import carrying_sentence as carrying_sentence
from truespring.report.verdict.causes import cause_sentence as cause_sentence
from truespring.report.verdict.drive import Drive as Drive
from truespring.report.verdict.drive import drive as drive
from truespring.report.verdict.forces import force_sentence as force_sentence
from truespring.report.verdict.moduli import material_name as material_name
from truespring.report.verdict.moduli import moduli_sentence as moduli_sentence
from truespring.report.verdict.naming import deep as deep
from truespring.report.verdict.naming import display_name as display_name
from truespring.report.verdict.naming import level_name as level_name
from truespring.report.verdict.naming import linear_fem as linear_fem
from truespring.report.verdict.nearest import closest_sentence as closest_sentence
from truespring.report.verdict.nearest import nearest_reference as nearest_reference
from truespring.report.verdict.reach import reach as reach
from truespring.report.verdict.trouble import path_trouble as path_trouble
from truespring.report.verdict.whole import verdict as verdict
from truespring.report.verdict.whole import verdict_sentences as verdict_sentences
