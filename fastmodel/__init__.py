"""The fast model: rigid texels in MuJoCo, point spread function, Butterworth filter, electronics."""
