"""The commands, one module each.

Only light packages may be imported at the top of these modules: every help page imports them all.
"""
