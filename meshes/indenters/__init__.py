"""Rigid indenters, one family of shapes per file. Each shape is defined once and serves both models."""
