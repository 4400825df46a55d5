"""Values that the companion's parts exchange: takes SI numbers and gives horizons, obstacles and settings."""
