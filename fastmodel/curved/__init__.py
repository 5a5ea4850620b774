"""The fast model of a curved cover: compliance between points of its surface, contact, and an operator to the texels.

`CurvedCover` holds the arrays, which `validation.derivation.curved` computes by the reference.  `press_curved` presses
rigid indenters at a pose and under a load, without a simulation.  `CurvedContact` is the contact method in MuJoCo.
"""
