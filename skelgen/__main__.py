"""``python -m skelgen`` is the command line."""

import sys

from skelgen.cli import main

sys.exit(main())
