"""`python -m app` is `elastune`."""

import sys

from app.cli import main

sys.exit(main())
