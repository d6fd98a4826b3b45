"""The command line, as the program `kincal` has it."""

import sys

from ._native import run_command_line


def main() -> int:
    """Runs it with the arguments of this process; returns 0 done, 1 input at fault, 2 usage."""
    return run_command_line(["kincal", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
