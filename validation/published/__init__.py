"""Published models of tactile arrays, scored against the same finite-element reference as the fast model.

`scene` gives what all models need of one press, `rules` holds the models, and `models` is the table of all of them and
fits their parameters to a few presses that are never scored.  docs/comparison-models.md states equations, sources and
what is not known.

All presses are held loads, so filters in time, dampers and noise have no effect and are not built.
"""
