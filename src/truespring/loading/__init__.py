"""Loads and supports: dead loads, loads that follow the body, fixed nodes and prescribed motions."""

from truespring.loading.active import ActiveTension as ActiveTension
from truespring.loading.body import Body as Body
from truespring.loading.body import Spread as Spread
from truespring.loading.body import nodal_force as nodal_force
from truespring.loading.dead import Force as Force
from truespring.loading.dead import Gravity as Gravity
from truespring.loading.dead import Traction as Traction
from truespring.loading.load import BodyForce as BodyForce
from truespring.loading.load import DeadLoad as DeadLoad
from truespring.loading.load import FacePressure as FacePressure
from truespring.loading.load import FollowingLoad as FollowingLoad
from truespring.loading.load import Load as Load
from truespring.loading.load import Mark as Mark
from truespring.loading.moment import Moment as Moment
from truespring.loading.pressure import Pressure as Pressure
from truespring.loading.supports import Fixed as Fixed
from truespring.loading.supports import Held as Held
from truespring.loading.supports import held_by as held_by
from truespring.loading.table import LOADS as LOADS
from truespring.loading.table import LoadKind as LoadKind
from truespring.loading.table import Quantity as Quantity
from truespring.loading.words import selection_words as selection_words
from truespring.loading.words import vector_words as vector_words
