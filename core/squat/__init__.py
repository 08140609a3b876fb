"""Single-leg squats: repetitions, their measures, and the sensitivity of the angles."""
