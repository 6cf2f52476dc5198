"""How a body is loaded and held: dead loads, loads that follow the body, supports and prescribed motions."""

from truespring.loading.dead import Body as Body
from truespring.loading.dead import DeadLoad as DeadLoad
from truespring.loading.dead import Force as Force
from truespring.loading.dead import Gravity as Gravity
from truespring.loading.dead import Spread as Spread
from truespring.loading.dead import Traction as Traction
from truespring.loading.dead import nodal_force as nodal_force
from truespring.loading.following import FollowingLoad as FollowingLoad
from truespring.loading.following import Moment as Moment
from truespring.loading.following import Pressure as Pressure
from truespring.loading.supports import Fixed as Fixed
from truespring.loading.supports import Held as Held
from truespring.loading.supports import held_by as held_by
