"""python -m truespring: the command line."""

import sys

from truespring.cli import main

sys.exit(main())
