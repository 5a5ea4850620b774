"""Frictionless contact at small strain, on the compliance of the top surface.

`frictionless` presses one indenter and `several_indenters` presses several at once, both by `constrained_solver`.
`free_edges` adds the compliance due to the free side edges of a cover of limited size.
"""
