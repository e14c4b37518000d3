"""`python -m elastune` is `elastune`."""

import sys

from elastune.app.cli.main import main

sys.exit(main())
