"""The commands of `softcover`, one or a few related commands per module.

The list of all commands imports every module of this folder, so only packages that load fast may be imported at the top
of a module.
"""
