"""``python -m fasaco_edge``."""

import sys

from fasaco_edge.cli import main

sys.exit(main())
