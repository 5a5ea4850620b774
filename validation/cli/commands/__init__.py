"""The commands of `softcover`, one or a few related commands per module.

The list of all commands imports every module of this folder.  Only packages with a short import time may therefore be
imported at the top of a module.
"""
