"""From a sensor file to the parameters of the fast model: reference response, then fit."""
