"""Published models of tactile arrays, scored against the same finite-element reference as the fast model.

`scene` gives what all models need of one press, `contact_points`, `penetration` and `contact_map` hold the models by
what they take the texel forces from, `models` is the table of all of them, and `calibration` fits their parameters to a
few presses that are never scored.  docs/comparison-models.md states equations, sources and what is not known.

All presses are held loads, so filters in time, dampers and noise have no effect and are not built.
"""
