"""Many points of one study: solved on all cores or a cluster, kept whole, gone on with where they broke off."""

from truespring.sweeping.pool import Failure as Failure
from truespring.sweeping.pool import Pool as Pool
from truespring.sweeping.pool import run_points as run_points
