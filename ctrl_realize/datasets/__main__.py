"""Print the path of a file of a data set: ``python -m ctrl_realize.datasets NAME [FILE]``."""

import sys
from collections.abc import Sequence

from ctrl_realize.datasets import names, path
from ctrl_realize.errors import OptionError


def main(arguments: Sequence[str]) -> int | str:
    """Print a path, or all names without arguments; return what `sys.exit` takes."""
    try:
        lines = [str(path(*arguments[:2]))] if arguments else names()
    except OptionError as problem:
        return str(problem)
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
