"""How the fruits of a map grow, and what to decide: forecasts, size classes, thinning, agreement with calipers."""
