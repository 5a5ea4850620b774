"""Parsing of quantities with units, indenters and hardness from text. Units are converted to SI only in this folder."""
