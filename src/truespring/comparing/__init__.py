"""Compare results of studies, result folders and files of other programs."""

from truespring.comparing.compare import compare_sources as compare_sources
from truespring.comparing.compare import read_probe as read_probe
from truespring.comparing.result import Comparisons as Comparisons
from truespring.comparing.sources import find_sources as find_sources
