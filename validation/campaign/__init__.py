"""Campaigns: lists of indentations, each computed by finite elements and by the fast model in MuJoCo and scored."""
