"""Scenes, solver, output and the command line of Elastune."""
