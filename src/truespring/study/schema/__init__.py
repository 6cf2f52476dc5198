"""Pydantic models of the keys of study files: they check values, convert them to SI units and build objects."""

from truespring.study.schema.body import AnyLoad as AnyLoad
from truespring.study.schema.body import LoadKeys as LoadKeys
from truespring.study.schema.body import MaterialKeys as MaterialKeys
from truespring.study.schema.body import SectionKeys as SectionKeys
from truespring.study.schema.body import SupportKeys as SupportKeys
from truespring.study.schema.body import load_form as load_form
from truespring.study.schema.body import with_constants as with_constants
from truespring.study.schema.meshes import MESH_FORMS as MESH_FORMS
from truespring.study.schema.meshes import SHAPES as SHAPES
from truespring.study.schema.meshes import MeshKeys as MeshKeys
from truespring.study.schema.meshes import ShapeKeys as ShapeKeys
from truespring.study.schema.models import MODEL_KINDS as MODEL_KINDS
from truespring.study.schema.models import ModelKeys as ModelKeys
from truespring.study.schema.models import Scope as Scope
from truespring.study.schema.models import SpringsKeys as SpringsKeys
from truespring.study.schema.models import TerzopoulosKeys as TerzopoulosKeys
from truespring.study.schema.tools import ToolKeys as ToolKeys
from truespring.study.schema.tools import key_of_tool as key_of_tool
from truespring.study.schema.values import FILE as FILE
from truespring.study.schema.values import Keys as Keys
from truespring.study.schema.whole import CompareKeys as CompareKeys
from truespring.study.schema.whole import SolverKeys as SolverKeys
from truespring.study.schema.whole import StudyKeys as StudyKeys
