"""`press`: one indentation by the solver that fits the cover, the indenter and the friction."""
