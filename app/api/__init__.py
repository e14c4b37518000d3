"""The Python interface: what a script or a notebook calls, see `elastune`."""
