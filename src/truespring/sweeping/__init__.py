"""Sweeps: one study with many values, solved on all cores or a cluster; an interrupted sweep can be continued."""

from truespring.sweeping.pool import Failure as Failure
from truespring.sweeping.pool import Pool as Pool
from truespring.sweeping.pool import require_dask as require_dask
from truespring.sweeping.result import Sweep as Sweep
from truespring.sweeping.result import write_sweep as write_sweep
from truespring.sweeping.sweep import plan_sweep as plan_sweep
from truespring.sweeping.sweep import run_sweep as run_sweep
from truespring.sweeping.sweep import sweep as sweep
from truespring.sweeping.values import read_vary as read_vary
