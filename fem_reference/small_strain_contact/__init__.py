"""Frictionless contact of rigid indenters with a cover at small strain, from the compliance of the cover's top.

`frictionless` presses one indenter and `several_indenters` presses several at once, both with `constrained_solver`.
`free_edges` adds the compliance due to the free side edges of a cover of limited size.
"""
