"""How a simulated person walks: feet, pelvis, legs, timing, soft tissue."""
