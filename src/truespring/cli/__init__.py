"""The command line: parse arguments, call the library, print results."""

from truespring.cli.command import main as main
