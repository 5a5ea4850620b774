"""Contact of rigid indenters with a cover at small strain.

`frictionless` presses one indenter and `several_indenters` presses several at once, both with `constrained_solver`,
from the compliance of the cover's top.  `free_edges` adds the compliance due to the free side edges of a cover of
limited size.  `friction_cells` adds friction, on covers of every kind.
"""
