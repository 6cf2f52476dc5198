"""The command line: parses, calls, prints; nothing else."""

from truespring.cli.command import main as main
