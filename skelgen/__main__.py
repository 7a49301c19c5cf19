"""``python -m skelgen`` is the command line."""

import sys

from skelgen.cli import main

if __name__ == "__main__":  # worker processes load this file too
    sys.exit(main())
