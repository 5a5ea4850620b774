"""Quantities, indenters and hardness as text. Units are converted to SI here and nowhere else."""
