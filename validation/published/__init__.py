"""Published models of tactile arrays, scored against the same finite-element reference as the fast model.

`scene` computes the common inputs of all models for one press.  `model` is the interface of a model.  Every file of
`rules` holds one or several models; a new file is found without further entries.  `models` fits the parameters of all
models to a few presses that are never scored.  docs/comparison-models.md states equations, sources and unknown details.

All presses are held loads.  Filters in time, dampers and noise therefore have no effect and are not implemented.
"""
