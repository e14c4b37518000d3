"""`python -m elastune` is `elastune`."""

import signal
import sys

# Ctrl-C ends without a traceback also before the command listens to it.
signal.signal(signal.SIGINT, signal.SIG_DFL)

from elastune.app.cli.main import main  # noqa: E402

sys.exit(main())
