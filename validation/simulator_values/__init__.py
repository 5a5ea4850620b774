"""Values that other simulators ask for, fitted to finite elements over a range of loads and scored against them.

`models` holds the contact laws of the simulators, `scoring` presses, fits and scores, and `targets` has the forms of
the files.  A new simulator is one entry of `TARGETS`: its laws, its form, and where the form was read.
"""
