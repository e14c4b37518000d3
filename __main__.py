"""`python -m elastune` is `elastune`."""

import signal
import sys

# Ctrl-C ends without a traceback also before the command listens to it; it may be ignored, in the background.
if signal.getsignal(signal.SIGINT) == signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from elastune.app.cli.main import main

sys.exit(main())
