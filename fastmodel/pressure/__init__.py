"""The pressure between rigid bodies and the cover on cells of the contact grid, from the gap and MuJoCo's forces."""
