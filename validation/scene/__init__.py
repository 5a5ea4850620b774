"""Pictures of covers in three dimensions: deformed cover with pressure and stress, sections, texel forces."""
