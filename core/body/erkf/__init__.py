"""Error-state Kalman filter of a chain of IMUs (Potter 2021), with smoother."""
