"""The pressure between bodies and the cover, cell by cell, from their gap and the forces that MuJoCo found."""
