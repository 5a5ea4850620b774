"""Rigid indenters that press on a cover, one shape or family of shapes per file."""
